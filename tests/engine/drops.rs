//! Margin drops and scores against a plain loop in f64, on every backend, and the certificate made of them.

use crate::common::{backends, cpu, race_policy, race_settings};
use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::rollout::drops::{Shapes, drops};
use reachcast::rollout::replay::{self, PairMargins};
use reachcast::rollout::{
    DeviationTask, PairControl, Pairs, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts,
    Stream,
};
use reachcast::scenario::drops_record::SequenceOutcome;
use reachcast::scenario::drops_settings::{ConditionalRisk, DropSettings, SampleSettings};
use reachcast::scenario::growth_plan::{Around, GrowthPlan};
use reachcast::scenario::record::Record;
use reachcast::scenario::sequential_record::{SequentialOf, SequentialSettings};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{CheckReport, Unwatched, certify, check, query};
use reachcast::system::{BangBang, DoubleIntegrator, System};

/// How far a backend's f32 score may lie from f64, relative to the larger of it and 1.
const BAND: f64 = 2e-4;

fn race() -> (Plant, Region) {
    let system = DroneRace::default();
    let (low, high) = (system.states().map(|a| a.low), system.states().map(|a| a.high));
    (Plant::of(system, race_policy()), Region::new_box(low, high).expect("box"))
}

fn line() -> (Plant, Region) {
    let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    (plant, Region::new_box([-1.2, -1.5], [1.2, 1.5]).expect("box"))
}

fn task<'a>(
    region: Region,
    shapes: &'a reachcast::rollout::Tightening,
    control: PairControl,
) -> DeviationTask<'a> {
    let stream = |number| Stream::new(3, Purpose::USER, number);
    DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: stream(1) },
            radius: 0.1,
            stream: stream(2),
        },
        range: 0..300,
        spec: RolloutSpec::new(30, 1.0).expect("a horizon"),
        tightening: shapes,
        control,
    }
}

/// Units that differ from step to step and from each other.
fn shapes() -> Shapes {
    let steps = || (0..=30).map(f64::from);
    Shapes {
        target: steps().map(|t| 0.1 + 0.01 * t).collect(),
        constraint: steps().map(|t| 0.3 - 0.005 * t).collect(),
    }
}

/// The margins of both rollouts, step by step, and the pair's largest drop and nominal score, by loops.
fn by_loops(plant: &Plant, [nominal, perturbed]: [&[f32]; 2], control: PairControl) -> [f64; 2] {
    let (units, model) = (shapes(), &plant.model);
    let wide = |x: &[f32]| -> Vec<f64> { x.iter().copied().map(f64::from).collect() };
    let (mut x, mut y) = (wide(nominal), wide(perturbed));
    let (mut z, mut score, mut safe) = (f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY);
    let mut failed = false;
    for t in 0..=30 {
        let step = t as u32;
        let (r, c) = (model.target_at(&x, step), model.constraint_at(&x, step));
        failed |= c <= 0.0;
        if !failed {
            z = z.max((r - model.target_at(&y, step)) / units.target[t]);
            z = z.max((c - model.constraint_at(&y, step)) / units.constraint[t]);
        }
        safe = safe.min(c / units.constraint[t]);
        score = score.max(safe.min(r / units.target[t]));
        let u = plant.control(&x, step);
        let of_y = match control {
            PairControl::Replay => u.clone(),
            PairControl::ClosedLoop => plant.control(&y, step),
        };
        (x, y) = (model.next(&x, &u, step), model.next(&y, &of_y, step));
    }
    [z, score]
}

#[test]
fn drops_and_scores_in_f64_are_those_of_a_loop() {
    for (plant, region) in [race(), line()] {
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let units = shapes().units();
            let task = task(region.clone(), &units, control);
            let mut counted = 0;
            for index in task.range.clone() {
                let [nominal, perturbed] = task.pairs.pair(index);
                let pair = [&*nominal, &*perturbed];
                let [z, score] = by_loops(&plant, pair, control);
                let margins: PairMargins = replay::pair_margins(&plant, pair, &task.spec, control);
                let found = [shapes().largest(&margins), shapes().score(&margins.nominal)];
                let close = |a: f64, b: f64| a == b || (a - b).abs() <= 1e-9 * a.abs().max(1.0);
                assert!(close(found[0], z) && close(found[1], score), "{index}: {found:?}, {z}");
                counted += usize::from(drops(&margins).count() > 5);
            }
            assert!(counted > 100, "{counted} pairs have drops at more than five steps");
        }
    }
}

#[test]
fn every_backend_has_the_scores_of_f64() {
    for backend in backends() {
        for (plant, region) in [race(), line()] {
            for control in [PairControl::Replay, PairControl::ClosedLoop] {
                scores_are_close(&backend, &plant, region.clone(), control);
            }
        }
    }
}

fn scores_are_close(backend: &Backend, plant: &Plant, region: Region, control: PairControl) {
    let units = shapes().units();
    let task = task(region, &units, control);
    let program = backend.prepare(plant).expect("a program");
    let close = |found: f32, truth: f64, what: &str| {
        let far = (f64::from(found) - truth).abs() / truth.abs().max(1.0);
        assert!(far <= BAND, "{what}: {found}, {truth} in f64");
    };
    let mut pairs = Vec::new();
    let mut sink = |_, values: &[reachcast::rollout::PairMeasure]| {
        pairs.extend_from_slice(values);
        Ok(())
    };
    program.deviation(&task, &mut sink).expect("a batch");
    let starts = ReachAvoidTask {
        starts: task.pairs.nominal.clone(),
        range: task.range.clone(),
        spec: task.spec,
        tightening: &units,
        query: Query::Measure,
    };
    let mut alone = Vec::new();
    let mut sink = |_, values: &[f32]| {
        alone.extend_from_slice(values);
        Ok(())
    };
    program.reach_avoid(&starts, &mut sink).expect("a batch");
    for (index, (pair, alone)) in (0..).zip(pairs.iter().zip(alone)) {
        let [nominal, perturbed] = task.pairs.pair(index);
        let [_, score] = by_loops(plant, [&nominal, &perturbed], control);
        close(pair.nominal, score, "nominal");
        close(alone, score, "start");
        let pair_of = [&*nominal, &*perturbed];
        let (_, plain) = replay::pair_measures(plant, pair_of, &task.spec, &units, control);
        // Without units: the perturbed rollout keeps its margins as they are.
        close(pair.perturbed, plain, "perturbed");
    }
}

fn small() -> (Plant, Settings) {
    let system = DroneRace::default();
    let mut settings = race_settings(&system);
    settings.global.draws = 4000;
    let rigorous = DropSettings::rigorous().expect("settings");
    // Two thirds of the draws are not certifiable: a risk that the others can support.
    let risk = Some(ConditionalRisk::Asked(0.03));
    settings.drops = Some(DropSettings { risk, pilot: 200, share_draws: 5000, ..rigorous });
    (Plant::of(system, race_policy()), settings)
}

fn record(backend: &Backend, plant: &Plant, settings: &Settings) -> Record {
    let program = backend.prepare(plant).expect("a program");
    certify(&program, settings, serde_json::json!({}), &Unwatched).expect("a certificate")
}

#[test]
fn the_certificate_is_the_same_on_threads_and_holds_when_checked() {
    let (plant, settings) = small();
    let [one, two] = [1, 2].map(|threads| record(&cpu(threads), &plant, &settings));
    assert_eq!(Record { timing: one.timing.clone(), ..two }, one);
    let sequence = one.sequence.as_ref().expect("a sequence");
    assert_eq!(sequence.outcome, SequenceOutcome::Accepted);
    let chosen = &sequence.levels[sequence.chosen];
    assert_eq!(Some(one.global.accepted), chosen.accepted);
    assert!(one.global.claim.certified_risk <= 0.03 && one.global.claim.epsilon == Some(0.03));
    let share = one.global.share.expect("a share");
    let drops = one.drops.as_ref().expect("drops");
    let by_constants = drops.by_constants.expect("constants");
    assert!(share.inside > drops.share.inside && drops.share.point() > 0.05);
    assert!(by_constants.inside as f64 / (by_constants.draws as f64) < share.point());
    let backend = cpu(2);
    let program = backend.prepare(&plant).expect("a program");
    let sealed = one.clone().sealed().expect("sealed");
    let text = serde_json::to_string(&sealed).expect("JSON");
    let read = Record::read(&text).expect("a record");
    assert_eq!(read, sealed);
    let found = check(&program, &read, &settings, 1, &Unwatched).expect("a check");
    assert!(found.holds, "{:?}", found.findings);
    edited_counts_are_noticed(&program, &read, &settings);
}

fn edited_counts_are_noticed(
    program: &reachcast::backend::Program<'_>,
    record: &Record,
    settings: &Settings,
) {
    let state = reachcast::rollout::States::one(&settings.state);
    query(program, record, settings, state).expect("tiers of the record as it is");
    let mut fewer = record.clone();
    let sequence = fewer.sequence.as_mut().expect("a sequence");
    let chosen = sequence.chosen;
    sequence.levels[chosen].failures = Some(0);
    let mut lax = record.clone();
    let sequence = lax.sequence.as_mut().expect("a sequence");
    sequence.chosen = (sequence.chosen + 1) % sequence.levels.len();
    let mut share = record.clone();
    share.drops.as_mut().expect("drops").share.inside += 100;
    for (what, edited) in
        [("fewer failures", fewer), ("another level", lax), ("a larger share", share)]
    {
        let state = reachcast::rollout::States::one(&settings.state);
        let refused = query(program, &edited, settings, state).expect_err(what);
        println!("{refused}");
    }
}

/// A state is certified exactly where its score is above the level: `query` says so in one rollout.
#[test]
fn membership_follows_the_score() {
    let (plant, settings) = small();
    let backend = cpu(2);
    let record = record(&backend, &plant, &settings);
    let program = backend.prepare(&plant).expect("a program");
    let sequence = record.sequence.as_ref().expect("a sequence");
    let (level, shapes) =
        (sequence.level().expect("a level"), record.drops.as_ref().expect("drops").shapes());
    let region = Region::new_box(&*settings.low, &*settings.high).expect("box");
    let starts = Starts::Drawn { region, stream: Stream::new(9, Purpose::USER, 0) };
    let states: Vec<[f32; 12]> = (0..400).map(|index| starts.start_array(index)).collect();
    let rows = query(&program, &record, &settings, states.as_slice().into()).expect("tiers");
    let mut inside = 0;
    let alpha = record.calibration.as_ref().expect("a calibration").level;
    let units = Shapes::of_discount(&settings.spec);
    for (x, row) in states.iter().zip(rows) {
        let margins = replay::states_margins(&plant, x, &settings.spec);
        let [score, measure] = [&shapes, &units].map(|shapes| shapes.score(&margins));
        let said = [row.beside.score, row.beside.measure].map(|one| one.expect("a number"));
        for (said, truth) in said.into_iter().zip([score, measure]) {
            assert!((said - truth).abs() <= BAND * truth.abs().max(1.0), "{said}, {truth} in f64");
        }
        if (measure - alpha).abs() > BAND {
            assert_eq!(row.beside.calibrated, Some(measure > alpha), "{measure}, {alpha}");
        }
        if (score - level).abs() > 1e-6 * level.max(1.0) {
            assert_eq!(row.check_margin > 0.0, score > level, "{score}, {level}");
        }
        inside += usize::from(score > level);
    }
    assert!((20..380).contains(&inside), "{inside} of 400");
}

#[test]
fn too_few_draws_say_what_the_risk_needs() {
    let (plant, mut settings) = small();
    settings.global.draws = 300;
    let record = record(&cpu(2), &plant, &settings);
    let sequence = record.sequence.as_ref().expect("a sequence");
    assert_eq!((sequence.outcome, sequence.levels.len()), (SequenceOutcome::Single, 1));
    let words = record.statements.join("\n");
    assert!(words.contains("was not tested") && words.contains("global.draws"), "{words}");
    let (claim, accepted) = (&record.global.claim, record.global.accepted);
    assert!(claim.epsilon == Some(0.03) && accepted > 0 && !record.holds, "{claim:?} {accepted}");
}

/// What is only looked for, and not shown, is told and is no claim that was missed.
#[test]
fn a_risk_that_is_looked_for_is_no_claim() {
    let (plant, mut settings) = small();
    let asked = settings.drops.as_mut().expect("drops");
    asked.risk = Some(ConditionalRisk::LookedFor(0.03));
    let shown = record(&cpu(2), &plant, &settings);
    assert_eq!(shown.global.claim.epsilon, Some(0.03), "the draws show it");
    assert_eq!(shown.looked_for(), None);
    settings.global.draws = 300;
    let few = record(&cpu(2), &plant, &settings);
    let claim = &few.global.claim;
    assert!(few.statements.join("\n").contains("was not tested"));
    let words = few.looked_for().expect("not found");
    assert!(words.starts_with("a risk of 0.03 was looked for"), "{words}");
    assert!(claim.epsilon == Some(settings.deviation.epsilon) && claim.is_obtained(), "{claim:?}");
}

/// The strict bound holds its own centre, and the centre of the larger set that the sequence chose lies outside.
#[test]
fn growth_starts_on_the_boundary_that_is_asked_for() {
    let (plant, mut settings) = small();
    for around in [Around::Set, Around::Bound] {
        settings.growth.plan = GrowthPlan { around, ..GrowthPlan::UPWARD };
        let record = record(&cpu(2), &plant, &settings);
        let (drops, sequence) = (record.drops.as_ref(), record.sequence.as_ref());
        let (drops, sequence) = (drops.expect("drops"), sequence.expect("a sequence"));
        let chosen = sequence.level().expect("a level");
        assert!(chosen < drops.level, "{chosen} {}", drops.level);
        let center = record.growth.center.as_ref().expect("a boundary");
        let held = [drops.level, chosen].map(|level| {
            let tightening = drops.shapes().tightening(level);
            replay::measure(&plant, center, &settings.spec, &tightening) > 0.0
        });
        assert_eq!(record.growth.around, around);
        assert_eq!(held, [around == Around::Bound, true], "{around:?}");
    }
}

/// Whether the finding of this name stands.
fn stands(report: &CheckReport, name: &str) -> bool {
    let found = report.findings.iter().find(|finding| finding.name == name);
    found.unwrap_or_else(|| panic!("no `{name}` in {report:?}")).holds
}

/// What a check says of the claims on fresh pairs and starts.
const ON_FRESH: [&str; 5] = [
    "fresh pairs beyond lambda",
    "fresh pairs that fail above alpha",
    "share of margin drops on fresh starts",
    "share of the calibration on fresh starts",
    "failures of the sequential claim on fresh starts",
];

#[test]
fn fresh_pairs_refute_a_level_that_is_too_small_and_no_true_one() {
    let (plant, mut settings) = small();
    settings.global.draws = 2000;
    // Risk enough for a pair of a few thousand to fail above alpha.
    let calibration = SampleSettings::new(0.003, 1e-3, 0).expect("a sample");
    settings.drops.as_mut().expect("drops").calibration = Some(calibration);
    settings.sequential = Some(SequentialSettings {
        of: SequentialOf::Box,
        epsilon: 0.9,
        beta: 1e-3,
        most: 5000,
        radius: 0.1,
        carried: 0.0,
    });
    let backend = cpu(2);
    let program = backend.prepare(&plant).expect("a program");
    let record = record(&backend, &plant, &settings);
    let checked = |record: Record, seed| {
        let sealed = record.sealed().expect("sealed");
        check(&program, &sealed, &settings, seed, &Unwatched).expect("a check")
    };
    for seed in 1..=4 {
        let report = checked(record.clone(), seed);
        assert!(report.holds && ON_FRESH.iter().all(|name| stands(&report, name)), "{report:?}");
    }
    let mut forged = record.clone();
    let drops = forged.drops.as_mut().expect("drops");
    (drops.level, drops.share.interval) = (0.5 * drops.level, [0.5, 0.6]);
    let calibration = forged.calibration.as_mut().expect("a calibration");
    assert!(calibration.level > 0.0, "nothing to make smaller");
    (calibration.level, calibration.share.interval) = (0.0, [0.5, 0.6]);
    forged.sequential.as_mut().expect("a claim").claim.certified_risk = 0.4;
    let report = checked(forged, 5);
    assert!(ON_FRESH.iter().all(|name| !stands(&report, name)), "{report:?}");
}
