//! What fails, fails as an error that says why.

use reachcast::backend::Backend;
use reachcast::backend::gpu::{Choice, Gpu, adapters};
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::rollout::{Query, ReachAvoidTask, RolloutSpec, Tightening};
use reachcast::system::{BangBang, DoubleIntegrator};
use reachcast::{Error, Fault, Result};

use crate::{drawn, gpu, race_policy, ramp, random_network, reach_avoid, whole_box};

#[test]
fn an_error_of_the_sink_stops_the_batch() {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let spec = RolloutSpec::new(1, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 1),
        range: 0..600_000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let mut calls = 0;
    let backend = Backend::Gpu(gpu);
    let program = backend.prepare(&plant).expect("it fits");
    let result = program.reach_avoid(&task, &mut |_, _| {
        calls += 1;
        Err(Error::Interrupted)
    });
    assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
    assert_eq!(calls, 1);
}

/// Measures of a small race batch with every kernel's text changed from `old` to `new`.
fn mutated(gpu: Gpu, old: &'static str, new: &'static str) -> Result<Vec<f32>> {
    let system = DroneRace::default();
    let plant = Plant::of(system, race_policy());
    let spec = RolloutSpec::new(10, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 28),
        range: 0..50,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let gpu = gpu.with_shader_edit(move |text| text.replace(old, new));
    reach_avoid(gpu, &plant, &task).1
}

#[test]
fn edited_kernels_are_the_ones_that_run() {
    let Some(first) = gpu() else { return };
    let plain = mutated(first, "no such text", "").expect("kernels as they are");
    let Some(second) = gpu() else { return };
    let edited = mutated(second, "discount * constraint_margin", "constraint_margin");
    assert_ne!(edited.expect("an edited kernel that is valid"), plain);
}

#[test]
fn a_kernel_that_does_not_compile_is_a_device_failure() {
    let Some(gpu) = gpu() else { return };
    let result = mutated(gpu, "fn judge(", "fn judge(,");
    assert!(
        matches!(&result, Err(Error::DeviceFailed { fault: Fault::Validation, .. })),
        "{result:?}"
    );
}

#[test]
fn a_network_of_the_wrong_shape_is_refused() {
    let Some(gpu) = gpu() else { return };
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[11, 8, 3], Activation::Relu));
    let spec = RolloutSpec::new(1, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 1),
        range: 0..1,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, result) = reach_avoid(gpu, &plant, &task);
    let text = result.expect_err("11 inputs for 12 states").to_string();
    assert!(text.contains("11 inputs") && text.contains("12 states"), "{text}");
}

#[test]
fn adapters_that_are_not_there_are_refused_with_what_is() {
    let name = "no such adapter";
    let error = Gpu::open(&Choice::Named(name.to_owned())).expect_err("a made-up name");
    let Error::Device(text) = error else { panic!("{error:?}") };
    for adapter in adapters() {
        assert!(text.contains(name) && text.contains(&adapter.name), "{text}");
    }
    assert!(text.contains("CPU backend"), "{text}");
}
