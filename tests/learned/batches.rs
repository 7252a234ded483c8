//! Batches of the learned cart on a backend against f64: measures, signs and pairs.

use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::rollout::{
    DeviationTask, PairControl, PairMeasure, Pairs, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, Stream, Tightening,
};

use super::{Law, Truth};

/// Largest distance from f64: some hundred roundings of numbers of a few units.
const BAND: f64 = 3e-5;
/// Starts or pairs.
const COUNT: u64 = 150;

fn starts(seed: u64) -> Starts<'static> {
    let region = Region::new_box([-1.3; 2], [1.3; 2]).expect("a box");
    Starts::Drawn { region, stream: Stream::new(seed, Purpose::USER, 3) }
}

fn spec() -> RolloutSpec {
    RolloutSpec::new(25, 0.96).expect("a horizon")
}

/// A tightening that differs at every step, so that no step can stand in for another.
fn ramp(spec: &RolloutSpec) -> Tightening {
    let steps = 0..=spec.horizon;
    Tightening {
        target: steps.clone().map(|t| 0.01 * t as f32).collect(),
        constraint: steps.map(|t| 0.02 * t as f32).collect(),
        ..Tightening::default()
    }
}

/// The state of a start, in f64.
fn state(start: &[f32]) -> [f64; 2] {
    [f64::from(start[0]), f64::from(start[1])]
}

/// The measures or signs of the first starts.
pub(crate) fn values(backend: &Backend, plant: &Plant, query: Query) -> Vec<f32> {
    let (spec, starts) = (spec(), starts(71));
    let task = ReachAvoidTask { starts, range: 0..COUNT, spec, tightening: &ramp(&spec), query };
    let program = backend.prepare(plant).expect("a plant that fits");
    let mut all = Vec::new();
    let ran = program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("it runs");
    all
}

/// The largest distance of measures of `plant` from those of the cart under `law` in f64, and the
/// number of starts that succeed; the signs must be those of the measures.
pub(crate) fn farthest(backend: &Backend, plant: &Plant, law: Law) -> (f64, u64) {
    let (truth, spec) = (Truth::new(law), spec());
    let [measures, signs] =
        [Query::Measure, Query::Sign].map(|query| values(backend, plant, query));
    let (mut farthest, mut passed) = (0.0_f64, 0);
    for (i, (measure, sign)) in measures.iter().zip(&signs).enumerate() {
        let start = state(&starts(71).start(i as u64));
        let [truth, _] = truth.pair([start; 2], &spec, &ramp(&spec), PairControl::Replay);
        farthest = farthest.max((f64::from(*measure) - truth).abs());
        assert!(truth.abs() <= BAND || (*sign > 0.0) == (*measure > 0.0), "{law:?}, start {i}");
        passed += u64::from(truth > 0.0);
    }
    (farthest, passed)
}

/// Requires measures and signs of the cart to be those of f64.
pub(crate) fn assert_measures(backend: &Backend, law: Law) {
    let (farthest, passed) = farthest(backend, &super::plant(law), law);
    println!("{law:?}: {farthest:e} off, {passed} of {COUNT} pass");
    assert!(farthest <= BAND, "{law:?}: {farthest} off");
    assert!(passed > 0 && passed < COUNT, "{law:?}: {passed} of {COUNT}: one sign only");
}

/// Requires the measures of pairs to be those of f64.
pub(crate) fn assert_pairs(backend: &Backend, law: Law, control: PairControl) {
    let (truth, spec) = (Truth::new(law), spec());
    let stream = Stream::new(73, reachcast::scenario::purpose::DEVIATION_PERTURBATION, 0);
    let pairs = Pairs { nominal: starts(72), radius: 0.2, stream };
    let task =
        DeviationTask { pairs, range: 3..3 + COUNT, spec, tightening: &ramp(&spec), control };
    let program = backend.prepare(&super::plant(law)).expect("a plant that fits");
    let mut found: Vec<PairMeasure> = Vec::new();
    let ran = program.deviation(&task, &mut |_, pairs| {
        found.extend_from_slice(pairs);
        Ok(())
    });
    ran.expect("it runs");
    for (i, found) in task.range.clone().zip(&found) {
        let [nominal, perturbed] = task.pairs.pair(i);
        let both = [state(&nominal), state(&perturbed)];
        let [nominal, perturbed] = truth.pair(both, &spec, task.tightening, control);
        let gaps = [f64::from(found.nominal) - nominal, f64::from(found.perturbed) - perturbed];
        let worst = gaps.map(f64::abs).into_iter().fold(0.0, f64::max);
        assert!(worst <= BAND, "{law:?}, {control:?}, pair {i}: {found:?} is {worst} off");
    }
}

/// The cart with `part` of its text replaced: another plant, whose measures must be seen to be.
pub(crate) fn assert_mutants_are_seen(backend: &Backend) {
    let mutants = [
        ("net('drag.safetensors', v, x)[1], t", "net('drag.safetensors', v, x)[0], t"),
        ("drag = \"net('drag.safetensors', v, x)", "drag = \"net('drag.safetensors', x, v)"),
        ("\"rk4\"", "\"euler\""),
        ("inside.safetensors', x, v)[0]", "inside.safetensors', x, v)[2]"),
        ("inside.safetensors', x, v)", "drag.safetensors', x, v)"),
        ("'pull.safetensors', x, v", "'pull.safetensors', v, x"),
    ];
    for (from, to) in mutants {
        let text = Law::Formula.cart();
        assert!(text.contains(from), "{from}");
        let plant = super::plant_of(&text.replacen(from, to, 1));
        let (farthest, _) = farthest(backend, &plant, Law::Formula);
        assert!(farthest > BAND, "{to} is not seen: {farthest}");
    }
}
