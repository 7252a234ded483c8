//! Signs of long rollouts: the device narrows its own dispatches, over many submissions, and the host stops
//! once all are decided.

use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::real::Real;
use reachcast::rollout::{Query, ReachAvoidTask, RolloutSpec, Starts, Tightening};
use reachcast::system::{Axis, System};

use crate::counts::Still;
use crate::gpu;
use crate::systems::Idle;

/// Moves up by a thousandth in each step: what starts below 0 reaches the target late.
#[derive(Clone)]
struct Late;

impl System<1, 1> for Late {
    fn name(&self) -> &str {
        "late"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [x + R::lit(1.0e-3) + R::lit(0.0) * u]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [_]: [R; 1]) -> R {
        R::lit(1.0e9)
    }
}

/// Steps: several submissions of signs under a formula.
const HORIZON: u32 = 2_000;

/// What was asked for of the starts `list`, and the submissions that it took.
fn found(
    backend: &Backend,
    program: &Program<'_>,
    list: &[[f32; 1]],
    query: Query,
) -> (Vec<f32>, u64) {
    let spec = RolloutSpec::new(HORIZON, 1.0).expect("a horizon");
    let task = ReachAvoidTask {
        starts: Starts::listed(list),
        range: 0..list.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query,
    };
    let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU") };
    let (before, mut all) = (gpu.traffic(), Vec::new());
    let sink = &mut |_, values: &[f32]| {
        all.extend_from_slice(values);
        Ok(())
    };
    program.reach_avoid(&task, sink).expect("it runs");
    (all, gpu.traffic().since(before).submissions)
}

#[test]
fn what_is_left_goes_on_over_many_submissions() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let program = backend.prepare(&Plant::of(Still, Idle)).expect("it fits");
    // Every third one is never decided.
    let mixed: Vec<[f32; 1]> = (0..1_000).map(|i| [if i % 3 == 0 { -0.5 } else { 0.5 }]).collect();
    let (signs, submissions) = found(&backend, &program, &mixed, Query::Sign);
    let expected: Vec<f32> = mixed.iter().map(|[x]| x.signum()).collect();
    assert_eq!(signs, expected);
    assert!(submissions > 3, "{submissions} submissions");
    let (measures, _) = found(&backend, &program, &mixed, Query::Measure);
    assert_eq!(measures, mixed.as_flattened());
    // All are decided at once: the host learns it one submission late.
    let (signs, submissions) = found(&backend, &program, &[[0.5]; 1_000], Query::Sign);
    assert_eq!((signs, submissions), (vec![1.0; 1_000], 2));
}

/// Without a change they all get there.
#[test]
fn what_is_decided_late_is_decided() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let program = backend.prepare(&Plant::of(Late, Idle)).expect("it fits");
    let (signs, submissions) = found(&backend, &program, &[[-0.5]; 500], Query::Sign);
    assert_eq!(signs, vec![1.0; 500]);
    assert!(submissions > 2, "{submissions} submissions");
}

/// What the device narrows must be what is left: each of these changes is seen.
#[test]
fn dispatches_that_are_narrowed_wrongly_are_seen() {
    let mixed: Vec<[f32; 1]> = (0..1_000).map(|i| [if i % 3 == 0 { -0.5 } else { 0.5 }]).collect();
    for (from, to) in [
        // The last workgroup is left out.
        ("(left + each - 1u) / each", "left / each"),
        // The last one that is left is forgotten.
        ("COLUMNS_WORD] = left;", "COLUMNS_WORD] = left - 1u;"),
    ] {
        let Some(gpu) = gpu() else { return };
        let gpu = gpu.with_shader_edit(move |text| text.replace(from, to));
        let backend = Backend::Gpu(gpu);
        let program = backend.prepare(&Plant::of(Late, Idle)).expect("it fits");
        let (signs, _) = found(&backend, &program, &mixed, Query::Sign);
        assert!(signs.contains(&-1.0), "`{to}` is not seen");
    }
}
