//! Every kind of task on every backend: measures, signs, pairs and distances; and kernels that break a rule.

use reachcast::backend::Backend;
use reachcast::model::{Plant, Task};
use reachcast::rollout::{
    DeviationTask, Keep, PairControl, Pairs, Query, ReachAvoidTask, Tightening,
};
use reachcast::train::chosen::chosen_first;

use crate::common::backends;
use crate::mathematics::{
    BAND, BETWEEN, CONSTRAINT, Case, ELLIPSE, HORIZON, POLICY, STARTS, SUBSTEPS, TARGET, cases,
    fine, fine_after, fine_pair, is_edge, looked, losses, pairs, plant, spec, starts,
    starts_within,
};

/// Requires `found` to be `wanted` up to f32.
fn close(found: f32, wanted: f64, about: &str) -> Result<(), String> {
    let near = (f64::from(found) - wanted).abs() <= BAND * wanted.abs().max(1.0);
    near.then_some(()).ok_or_else(|| format!("{about}: {found}, not {wanted}"))
}

/// The measures or signs of the first `count` starts.
fn found_of(
    backend: &Backend,
    plant: &Plant,
    query: Query,
    count: u64,
) -> Result<Vec<f32>, String> {
    let (losses, range) = (losses(), 0..count);
    let program = backend.prepare(plant).map_err(|e| e.to_string())?;
    let (starts, spec, tightening) = (starts(), spec(), &losses);
    let task = ReachAvoidTask { starts, range: range.clone(), spec, tightening, query };
    let tally = program.tally(&task, Keep::Measures);
    let found = tally.and_then(|tally| tally.finish(range));
    found.map(|found| found.values).map_err(|e| e.to_string())
}

/// Those of all starts.
fn found(backend: &Backend, plant: &Plant, query: Query) -> Result<Vec<f32>, String> {
    found_of(backend, plant, query, STARTS)
}

/// Whether measures and signs of a task on `backend` are those of its definition.
fn measures_agree(backend: &Backend, case: &Case) -> Result<(), String> {
    let (plant, losses) = (case.plant(), losses());
    let measures = found(backend, &plant, Query::Measure)?;
    let signs = found(backend, &plant, Query::Sign)?;
    let (mut edges, mut successes) = (0, 0);
    for (i, (measure, sign)) in measures.into_iter().zip(signs).enumerate() {
        let about = format!("{}, start {i}, {}", case.name(), backend.name());
        if (measure > 0.0) != (sign > 0.0) {
            return Err(format!("{about}: measure {measure}, sign {sign}"));
        }
        let states = fine(&starts().start(i as u64));
        if is_edge(&states) {
            edges += 1;
            continue;
        }
        let wanted = case.wanted(&states, &losses);
        successes += u64::from(wanted > 0.0);
        close(measure, wanted, &about)?;
    }
    let share = successes as f64 / STARTS as f64;
    println!("{} on {}: {successes} succeed, {edges} at an edge", case.name(), backend.name());
    let telling = edges < 60 && (0.01..0.99).contains(&share);
    telling.then_some(()).ok_or_else(|| format!("{}: {share} succeed, {edges}", case.name()))
}

/// Whether both measures of pairs on `backend` are those of the definition.
fn pairs_agree(backend: &Backend, case: &Case, control: PairControl) -> Result<(), String> {
    let (plant, losses) = (case.plant(), losses());
    let (pairs, spec, range) = (pairs(), spec(), 0..STARTS / 5);
    let (tightening, range_of) = (&losses, range.clone());
    let asked = DeviationTask { pairs: pairs.clone(), range: range_of, spec, tightening, control };
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let mut found = Vec::new();
    let mut sink = |_, pairs: &[_]| {
        found.extend_from_slice(pairs);
        Ok(())
    };
    program.deviation(&asked, &mut sink).map_err(|e| e.to_string())?;
    for (i, pair) in range.zip(found) {
        let [nominal, perturbed] = fine_pair(&pairs.pair(i), control);
        if is_edge(&nominal) || is_edge(&perturbed) {
            continue;
        }
        let about = format!("{}, pair {i}, {control:?}, {}", case.name(), backend.name());
        close(pair.nominal, case.wanted(&nominal, &losses), &about)?;
        close(pair.perturbed, case.wanted(&perturbed, &Tightening::none(&spec)), &about)?;
    }
    Ok(())
}

/// The distance of a pair at each step: the largest of its sample and of the points before it.
fn apart(between: usize, [along, beside]: &[Vec<[f64; 2]>; 2]) -> Vec<f64> {
    let mut most = vec![0.0_f64; HORIZON as usize + 1];
    for ((substeps, x), (_, y)) in looked(between, along).zip(looked(between, beside)) {
        let distance = (x[0] - y[0]).hypot(x[1] - y[1]);
        let most = &mut most[substeps.div_ceil(SUBSTEPS)];
        *most = distance.max(*most);
    }
    most
}

/// Whether the distances on `backend` are those of fine trajectories, pair by pair.
fn distances_agree(backend: &Backend, between: usize, asked: PairControl) -> Result<(), String> {
    let case = Case { task: Task::AtEnd, lines: "kind = \"at-end\"\n", between };
    let (plant, spec) = (case.plant(), spec());
    let none = Tightening::none(&spec);
    // Far from where anything is lost.
    let pairs = Pairs { nominal: starts_within(0.5), ..pairs() };
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let mut inside = 0;
    for i in 0..30 {
        let (tightening, pairs_of) = (&none, pairs.clone());
        let task =
            DeviationTask { pairs: pairs_of, range: i..i + 1, spec, tightening, control: asked };
        let found = program.deviation(&task, &mut |_, _| Ok(())).map_err(|e| e.to_string())?;
        let states = fine_pair(&pairs.pair(i), asked);
        let (wanted, samples) = (apart(between, &states), apart(0, &states));
        for (t, (found, wanted)) in found.into_iter().zip(&wanted).enumerate() {
            let about = format!("{between} between, pair {i}, step {t}, {}", backend.name());
            close(found.distance, *wanted, &about)?;
            if found.pair != i {
                return Err(format!("{about}: found at pair {}", found.pair));
            }
            inside += u64::from(*wanted > samples[t] + BAND);
        }
    }
    let telling = inside > 10;
    telling.then_some(()).ok_or_else(|| format!("{inside} distances are largest inside"))
}

fn agree(backend: &Backend) -> Result<(), String> {
    for case in cases() {
        measures_agree(backend, &case)?;
        pairs_agree(backend, &case, PairControl::Replay)?;
        pairs_agree(backend, &case, PairControl::ClosedLoop)?;
    }
    for between in BETWEEN {
        distances_agree(backend, between, PairControl::Replay)?;
        distances_agree(backend, between, PairControl::ClosedLoop)?;
    }
    Ok(())
}

#[test]
fn every_kind_is_its_definition_on_every_backend() {
    for backend in backends() {
        agree(&backend).unwrap_or_else(|problem| panic!("{problem}"));
    }
}

/// A trajectory that leaves its lane for another takes its time along: signs of plants whose dynamics and policy
/// read the time are those of their measures.
#[test]
fn signs_of_plants_that_change_with_the_time_are_those_of_measures() {
    for lines in ["kind = \"reach-avoid\"\n", "kind = \"reach-avoid\"\nbetween = 3\n"] {
        let text = format!("{ELLIPSE}[model.task]\n{lines}{TARGET}{CONSTRAINT}{POLICY}");
        let plant = plant(&text.replace("0.5 * sin(3 * t)", "5 * sin(3 * t)")).expect("a plant");
        for backend in backends() {
            // More than a tile of any width holds, so that lanes change hands.
            let of = |query| found_of(&backend, &plant, query, 40_000).expect("run");
            let positive = |found: Vec<f32>| found.iter().map(|g| *g > 0.0).collect::<Vec<_>>();
            let [signs, measures] = [Query::Sign, Query::Measure].map(|query| positive(of(query)));
            assert_eq!(signs, measures, "{} {lines}", backend.name());
        }
    }
}

/// Of every kind, what Q(x, u) learns: the measure of the rollout whose first control is given.
#[test]
fn a_first_control_that_is_given_is_the_first_of_its_rollout_alone() {
    for backend in backends() {
        let mut apart = 0;
        for case in cases() {
            let plant = chosen_first(&case.plant());
            let program = backend.prepare(&plant).expect("prepared");
            let push = |i: u64| 0.19 * (2.4 * i as f32).sin();
            let rows: Vec<[f32; 3]> =
                (0..200).map(|i| [starts().start(i)[0], starts().start(i)[1], push(i)]).collect();
            let found = program.measures(&rows, &spec()).expect("run");
            let none = Tightening::none(&spec());
            for (row, found) in rows.iter().zip(found) {
                let states = fine_after(&row[..2], row[2]);
                if is_edge(&states) {
                    continue;
                }
                let wanted = case.wanted(&states, &none);
                let about = format!("{}, {row:?}, {}", case.name(), backend.name());
                close(found, wanted, &about).unwrap_or_else(|problem| panic!("{problem}"));
                let driven = case.wanted(&fine(&row[..2]), &none);
                apart += u64::from((driven - wanted).abs() > BAND);
            }
        }
        assert!(apart > 500, "{apart} measures differ from those of the policy alone");
    }
}

mutants! {
    agree;
    a_point_left_out: "point < POINTS; point += 1u" => "point + 1u < POINTS; point += 1u";
    points_with_the_row_of_their_sample: "schedule[2u * t + 1u]" => "schedule[2u * t]";
    points_with_the_row_of_the_next_sample: "schedule[2u * t + 1u]" => "schedule[2u * t + 2u]";
    points_at_the_time_of_their_sample: "shares[t % POINTS]" => "0.0";
    points_at_the_number_of_the_next_sample: "f32(t / POINTS))" => "f32(t / POINTS + min(t % POINTS, 1u)))";
    parts_that_begin_late: "moment + point - 1u" => "moment + point";
    pairs_whose_parts_begin_late: "at - 1u" => "at";
    distances_of_samples_alone: "max(farthest_between, gap(nominal, perturbed))" => "0.0";
    distances_of_the_last_point_alone: "max(farthest_between, gap(nominal, perturbed))" => "gap(nominal, perturbed)";
    perturbed_rollouts_that_are_not_looked_at: "judge(perturbed_fold, perturbed, at, without_loss(between))" => "perturbed_fold";
}
