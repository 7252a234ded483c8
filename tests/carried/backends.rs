//! States and measures of each plant on every backend, against f64.

use reachcast::Error;
use reachcast::backend::Backend;
use reachcast::formula::record;
use reachcast::model::{Plant, Task};
use reachcast::real::Real;
use reachcast::rollout::{RolloutSpec, States};

use super::common::{adapter, cpu};
use super::formulas::mutants;
use super::truth::Truth;
use super::{all, plant, wide};

/// How far a rollout in f32 is led astray as if it had started elsewhere: rounding, relative to 1 or to the
/// largest coordinate. Each start is rolled out in f64 from this far to either side as well.
const ASTRAY: f64 = 4e-6;
/// Steps of the rollouts whose states are compared.
const SHORT: usize = 12;

/// The measures of `starts` on `backend`.
fn measures(
    backend: &Backend,
    plant: &Plant,
    starts: &[Vec<f32>],
    horizon: usize,
) -> Result<Vec<f32>, Error> {
    let spec = RolloutSpec::new(horizon as u32, 1.0)?;
    let rows = starts.concat();
    backend.prepare(plant)?.measures(States::new(&rows, starts[0].len())?, &spec)
}

/// `value` at `start`, and how far it moves where the start is led astray.
fn with_spread(start: &[f64], value: impl Fn(&[f64]) -> f64) -> [f64; 2] {
    let size = start.iter().fold(1.0, |size: f64, x| size.max(x.abs()));
    let exact = value(start);
    let apart = (0..start.len()).flat_map(|i| {
        [-ASTRAY, ASTRAY].map(|by| {
            let mut other = start.to_vec();
            other[i] += by * size;
            (value(&other) - exact).abs()
        })
    });
    let spread = apart.fold(ASTRAY * size.max(exact.abs()), f64::max);
    [exact, spread]
}

/// The values that `backend` finds against `value` in f64; nearly all of them are well determined.
fn compare(
    what: &str,
    found: &[f32],
    starts: &[Vec<f32>],
    value: impl Fn(&[f64]) -> f64,
) -> Result<(), String> {
    let mut vague = 0;
    for (found, start) in found.iter().zip(starts) {
        let [exact, spread] = with_spread(&wide(start), &value);
        let far = (f64::from(*found) - exact).abs();
        vague += usize::from(spread > 0.01 * exact.abs().max(0.1));
        if far > 3.0 * spread {
            return Err(format!("{what} of {start:?}: {found}, not {exact}; spread {spread}"));
        }
    }
    println!("{what}: {vague} of {} vague", starts.len());
    (10 * vague <= starts.len()).then_some(()).ok_or_else(|| format!("{what}: {vague} are vague"))
}

/// The plant whose measure is a sum of its states at the end, each with a weight of its own.
fn summed(plant: &Plant) -> Plant {
    let mut model = plant.model.as_ref().clone();
    let (inputs, states) = (model.inputs(), model.states.len());
    model.task = Task::AtEnd;
    model.target = record(inputs, |x| {
        let weighted = |i: usize| x[i] * Real::lit(1.0 + i as f32);
        vec![(1..states).map(weighted).fold(x[0], |sum, x| sum + x)]
    });
    model.constraint = record(inputs, |_| vec![Real::lit(1e6)]);
    Plant::new(model, plant.controller.as_ref().clone())
}

/// Whether the states of short rollouts on `backend` are those of `truth`.
fn states_agree(
    backend: &Backend,
    truth: &Truth,
    plant: &Plant,
    starts: &[Vec<f32>],
) -> Result<(), String> {
    let found = measures(backend, &summed(plant), starts, SHORT).map_err(|e| e.to_string())?;
    compare(&format!("{}, states, {}", truth.file, backend.name()), &found, starts, |start| {
        let last = truth.states(start, SHORT).pop().expect("a state");
        (1..).zip(last).map(|(weight, x)| f64::from(weight) * x).sum()
    })
}

/// Whether the measures of whole rollouts on `backend` are those of `truth`.
fn measures_agree(
    backend: &Backend,
    truth: &Truth,
    plant: &Plant,
    starts: &[Vec<f32>],
) -> Result<(), String> {
    let horizon = truth.horizon();
    let found = measures(backend, plant, starts, horizon).map_err(|e| e.to_string())?;
    let what = format!("{}, measures, {}", truth.file, backend.name());
    compare(&what, &found, starts, |start| truth.measure(start, horizon))
}

/// Requires states and measures of every plant on `backend` to be those of its mathematics.
fn assert_agree(backend: &Backend, count: usize) {
    for truth in all() {
        let plant = truth.plant();
        let starts = truth.starts(&plant, count, 1.0);
        let states = states_agree(backend, &truth, &plant, &starts);
        let both = states.and_then(|()| measures_agree(backend, &truth, &plant, &starts));
        both.unwrap_or_else(|problem| panic!("{problem}"));
    }
}

#[test]
fn rollouts_on_the_cpu() {
    assert_agree(&cpu(2), 150);
}

#[test]
fn rollouts_on_an_adapter() {
    if let Some(gpu) = adapter() {
        assert_agree(&Backend::Gpu(gpu), 40);
    }
}

/// A plant one of whose states moves by a hundredth more is told from what it should be.
#[test]
fn another_plant_is_seen() {
    for truth in all() {
        let starts = truth.starts(&truth.plant(), 60, 1.0);
        let moves = |name: &str| name.starts_with("model.flow") || name.starts_with("model.next");
        for (name, text) in mutants(&truth.text()).into_iter().filter(|(name, _)| moves(name)) {
            let mutant = plant(&text).expect("a plant");
            let seen = states_agree(&cpu(2), &truth, &mutant, &starts).is_err();
            assert!(seen, "{}: a change of {name} is not seen", truth.file);
        }
    }
}
