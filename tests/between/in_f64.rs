//! In f64: every kind of task, margin drops, scores, tubes, and what training ascends.

use reachcast::model::Interface;
use reachcast::rollout::drops::Shapes;
use reachcast::rollout::replay::{self, measure_of, pair_margins, states_margins};
use reachcast::rollout::{NON_FINITE, PairControl, Pairs, Tightening};
use reachcast::train::soft::{Measured, further_tapes, measure_tape, step_tape};
use reachcast::train::tape::Tape;
use reachcast::tube::Tube;

use crate::mathematics::{
    BETWEEN, Case, HORIZON, STARTS, SUBSTEPS, Seen, cases, fine, fine_pair, is_edge, looked,
    losses, pairs, seen, spec, starts,
};

/// Requires f64 to be the brute force up to the rounding of literals to f32.
fn near(found: f64, wanted: f64) -> bool {
    (found - wanted).abs() <= 1e-5 * wanted.abs().max(1.0)
}

#[test]
fn every_kind_is_its_definition_in_f64() {
    let (spec, losses, mut inside) = (spec(), losses(), 0);
    for case in cases() {
        let (plant, name) = (case.plant(), case.name());
        assert_eq!((plant.model.task, plant.model.points), (case.task, case.between as u32 + 1));
        for i in 0..STARTS {
            let start = starts().start(i);
            let states = fine(&start);
            let found = replay::measure(&plant, &start, &spec, &losses);
            let wanted = case.wanted(&states, &losses);
            assert!(near(found, wanted), "{name}, start {i}: {found}, not {wanted}");
            let samples = Case { between: 0, ..case };
            inside += u64::from((samples.wanted(&states, &losses) > 0.0) != (wanted > 0.0));
        }
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            for i in 0..STARTS / 10 {
                let both = pairs().pair(i);
                let of = [&*both[0], &*both[1]];
                let (nominal, perturbed) =
                    replay::pair_measures(&plant, of, &spec, &losses, control);
                let [along, beside] = fine_pair(&both, control);
                let wanted = case.wanted(&along, &losses);
                assert!(near(nominal, wanted), "{name}, pair {i}: {nominal}, not {wanted}");
                let wanted = case.wanted(&beside, &Tightening::none(&spec));
                assert!(near(perturbed, wanted), "{name}, pair {i}: {perturbed}, not {wanted}");
            }
        }
    }
    println!("{inside} starts succeed by their samples alone or not at all");
    assert!(inside > 100, "{inside}");
}

/// The samples of a rollout are those of the model without points.
#[test]
fn samples_are_those_of_the_whole_step() {
    let case = &cases()[0];
    let whole = |between: usize| Case { between, ..*case }.plant();
    for (i, plant) in BETWEEN.map(whole).iter().enumerate() {
        let start = starts().start(i as u64);
        let states = fine(&start);
        let samples = replay::states::<f64>(plant, &start, HORIZON);
        let looks = replay::looks::<f64>(plant, &start, HORIZON);
        assert_eq!(looks.len(), plant.model.looks(HORIZON));
        for (t, x) in samples.iter().enumerate() {
            assert_eq!(*x, looks[t * plant.model.points as usize]);
            let wanted = states[t * SUBSTEPS];
            assert!(near(x[0], wanted[0]) && near(x[1], wanted[1]), "{x:?}, not {wanted:?}");
        }
    }
}

/// What a tape makes of these inputs.
fn run(tape: &Tape, inputs: &[&[f64]]) -> Vec<f64> {
    let mut values = Vec::new();
    tape.forward(&inputs.concat(), 0.0, &mut values);
    tape.read(&values).collect()
}

/// The parts of a period that training steps through lead from look to look.
#[test]
fn the_parts_of_training_are_the_looks_of_a_rollout() {
    let mut compared = 0;
    for between in BETWEEN {
        let plant = Case { between, ..cases()[0] }.plant();
        let (model, interface) = (&*plant.model, Interface::plain(&plant.model));
        let (first, further) = (step_tape(model, &interface), further_tapes(model, &interface));
        for i in 0..50 {
            let looks = replay::looks::<f64>(&plant, &starts().start(i), HORIZON);
            for (step, period) in (0..HORIZON).zip(looks.windows(between + 2).step_by(between + 1))
            {
                let (x, t) = (&period[0], [f64::from(step)]);
                let u = plant.control(x, step);
                let mut found = vec![run(&first, &[x, &u, &t])];
                for part in &further {
                    let last = found[found.len() - 1].clone();
                    found.push(run(part, &[&last, x, &u, &t]));
                }
                assert_eq!(found.len(), between + 1);
                for (found, wanted) in found.iter().flatten().zip(period[1..].iter().flatten()) {
                    assert!(near(*found, *wanted) || wanted.is_nan(), "{found}, not {wanted}");
                    compared += u32::from(wanted.is_finite());
                }
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// The proof of margin drops, pair by pair: a pair whose drops are at most lambda, and whose nominal start is
/// certified at lambda, succeeds.
#[test]
fn a_nominal_start_certified_at_the_drop_of_its_pair_has_a_perturbed_one_that_succeeds() {
    let shape = |a: f64, b: f64| (0..=HORIZON).map(|t| a + b * f64::from(t)).collect();
    let sets = [[0.03, 0.3], [0.3, 0.03]].map(|[target, constraint]| Shapes {
        target: shape(target, 0.001),
        constraint: shape(constraint, 0.002),
    });
    let (spec, pairs) = (spec(), pairs());
    for case in cases() {
        let (plant, name) = (case.plant(), case.name());
        let (mut certified, mut tight) = (0, 0);
        for i in 0..6 * STARTS {
            let shapes = &sets[(i % 2) as usize];
            let both = pairs.pair(i);
            let margins = pair_margins(&plant, [&*both[0], &*both[1]], &spec, PairControl::Replay);
            let level = shapes.largest(&margins).max(0.0);
            if level == f64::INFINITY {
                continue;
            }
            let check = |level| measure_of(&margins.nominal, &spec, &shapes.tightening(level));
            let [_, perturbed] = fine_pair(&both, PairControl::Replay);
            let measure = case.wanted(&perturbed, &Tightening::none(&spec));
            if check(level) > 0.0 {
                certified += 1;
                assert!(measure > 0.0, "{name}, pair {i}: {measure} at level {level}");
            }
            tight += u64::from(measure <= 0.0 && check(0.5 * level) > 0.0);
        }
        println!("{name}: {certified} certified, {tight} that only half the level certifies");
        assert!(certified > 50 && tight > 0, "{name}: {certified} certified, {tight} tight");
    }
}

/// The score is the level at which a start ceases to be certified, whatever the task.
#[test]
fn a_start_is_certified_below_its_score_alone() {
    let shape = |a: f64, b: f64| (0..=HORIZON).map(|t| a + b * f64::from(t)).collect();
    let shapes = Shapes { target: shape(0.05, 0.01), constraint: shape(0.08, 0.005) };
    let spec = spec();
    for case in cases() {
        let (plant, mut positive) = (case.plant(), 0);
        for i in 0..300 {
            let margins = states_margins(&plant, &starts().start(i), &spec);
            let score = shapes.score(&margins);
            let check = |level| measure_of(&margins, &spec, &shapes.tightening(level));
            assert_eq!(score > 0.0, check(0.0) > 0.0, "{}, start {i}: {score}", case.name());
            if score > 0.0 {
                positive += 1;
                assert!(check(score * (1.0 - 1e-5)) > 0.0 && check(score * (1.0 + 1e-5)) <= 0.0);
            }
        }
        assert!(positive > 5, "{}: {positive} scores above 0", case.name());
    }
}

/// What a tube certifies no perturbation breaks, and its measure is nowhere above theirs; its sets hold every
/// state that is looked at.
#[test]
fn what_a_tube_certifies_holds_of_every_perturbed_start() {
    let spec = spec();
    let none = Tightening::none(&spec);
    let pairs = Pairs { radius: 0.02, ..pairs() };
    for (case, control) in
        cases().iter().zip([PairControl::Replay, PairControl::ClosedLoop].into_iter().cycle())
    {
        let (plant, name) = (case.plant(), case.name());
        let (mut certified, mut refused, mut by_constants) = (0, 0, 0);
        let tube = Tube::new(&plant, spec, control);
        for i in 0..300 {
            let both = pairs.pair(i);
            let nominal = tube.nominal(&both[0]);
            // A start of the pair lies within its radius up to f32.
            let below = tube.measure(&nominal, 0.0201);
            assert_eq!(tube.certifies(&nominal, 0.0201), below > 0.0, "{name}, {i}");
            let lipschitz = tube.lipschitz_measure(&nominal, 0.0201);
            let sides = tube.states(&nominal, 0.0201);
            let states = fine_pair(&both, control);
            for states in states.iter().filter(|states| !is_edge(states)) {
                for ((substeps, x), sides) in looked(case.between, states).zip(&sides) {
                    for (x, side) in x.iter().zip(sides) {
                        let held = side.low - 1e-6 <= *x && *x <= side.high + 1e-6;
                        assert!(held, "{name}, {i}, {substeps}: {x} outside of {side:?}");
                    }
                }
                let measure = case.wanted(states, &none);
                let sized = measure > f64::from(NON_FINITE);
                let most = if sized { measure + 1e-6 } else { 0.0 };
                assert!(
                    below.max(lipschitz) <= most,
                    "{name}, {i}: {below} and {lipschitz}, not {measure}"
                );
                refused += u64::from(measure <= 0.0);
            }
            certified += u64::from(below > 0.0);
            by_constants += u64::from(lipschitz > 0.0);
        }
        println!("{name}: {certified} certified, {by_constants} by constants, {refused} fail");
        assert!(certified > 3 && refused > 3, "{name}: {certified}, {refused}");
    }
}

/// What training ascends tends to the measure of the task as the temperature falls.
#[test]
fn the_softened_measure_tends_to_that_of_the_task() {
    let (spec, losses, temperature) = (spec(), losses(), 1e-4);
    for case in cases() {
        let (plant, mut compared) = (case.plant(), 0);
        let (spec, tightening, unit) = (&spec, Some(&losses), None);
        let tape = measure_tape(&plant.model, Measured { spec, tightening, unit });
        for i in 0..100 {
            let states = fine(&starts().start(i));
            let wanted = case.wanted(&states, &losses);
            let looks: Vec<(usize, [f64; 2])> = looked(case.between, &states).collect();
            // Training has no rule for what is no number.
            let number = |at: &(usize, [f64; 2])| {
                let Seen { finite, target, constraint, .. } = seen(*at, &losses);
                finite && !target.is_nan() && !constraint.is_nan()
            };
            if !looks.iter().all(number) {
                continue;
            }
            let numbers: Vec<f64> = looks.iter().flat_map(|(_, x)| *x).collect();
            let mut values = Vec::new();
            tape.forward(&numbers, temperature, &mut values);
            let found = tape.read(&values).nth(1).expect("the tightened measure");
            assert!((found - wanted).abs() < 2e-3, "{}, {i}: {found}, not {wanted}", case.name());
            compared += 1;
        }
        assert!(compared > 20, "{}: {compared}", case.name());
    }
}
