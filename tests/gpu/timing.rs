//! Times of kernels on the device, and its limits.

use reachcast::backend::gpu::{Gpu, KernelTime, NetworkKernels};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Mlp};
use reachcast::race::DroneRace;
use reachcast::rollout::{Query, ReachAvoidTask, RolloutSpec};

use crate::{drawn, gpu, measures, ramp, random_network, whole_box};

/// Measures of `count` starts of the race over 9 steps.
fn roll_out(gpu: Gpu, policy: &Mlp, count: u64) -> (Gpu, Vec<f32>) {
    let system = DroneRace::default();
    let spec = RolloutSpec::new(9, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 41),
        range: 0..count,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    measures(gpu, &Plant::of(system, policy.clone()), &task)
}

/// An adapter that has a dispatch per layer and step.
fn layered() -> Option<Gpu> {
    gpu().map(|gpu| gpu.with_networks(NetworkKernels::Layered))
}

#[test]
fn every_dispatch_of_the_plan_is_timed() {
    let Some(gpu) = layered() else { return };
    let policy = random_network(&[12, 16, 16, 3], Activation::Relu);
    let (gpu, plain) = roll_out(gpu, &policy, 100);
    assert_eq!(gpu.take_kernel_times(), [], "off at first");
    gpu.time_kernels(true);
    let (gpu, timed) = roll_out(gpu, &policy, 100);
    assert_eq!(plain, timed);
    let times = gpu.take_kernel_times();
    assert!(!times.is_empty(), "{} has no timestamps", gpu.device());
    let counts: Vec<_> = times.iter().map(|time| (time.kernel, time.dispatches)).collect();
    // One draw; 10 states are judged, and 9 of them moved by the three layers.
    assert_eq!(counts, [("sample", 1), ("mlp", 27), ("reach_avoid", 10)]);
    for KernelTime { kernel, seconds, .. } in &times {
        assert!(*seconds > 0.0 && *seconds < 10.0, "{kernel}: {seconds} s");
    }
    gpu.time_kernels(false);
    let (gpu, _) = roll_out(gpu, &policy, 100);
    assert_eq!(gpu.take_kernel_times(), [], "switched off");
}

#[test]
fn submissions_longer_than_a_set_of_queries_are_timed() {
    let Some(gpu) = layered() else { return };
    // 10 steps of 300 layers in one submission, 2048 to a set.
    let policy = random_network(&[&[12][..], &[4; 299], &[3]].concat(), Activation::Tanh);
    gpu.time_kernels(true);
    let (gpu, _) = roll_out(gpu, &policy, 10);
    let times = gpu.take_kernel_times();
    let layers = times.iter().find(|time| time.kernel == "mlp").expect("layers were timed");
    assert_eq!(layers.dispatches, 2700);
    assert!(layers.seconds > 0.0);
}

#[test]
fn limits_are_measured_and_hang_together() {
    let Some(gpu) = gpu() else { return };
    let limits = gpu.measure_limits().expect("limits");
    println!("{}: {limits:?}", gpu.device());
    // From a slow core to far beyond the largest GPU.
    assert!((1e8..1e15).contains(&limits.flops_per_second), "{limits:?}");
    assert!((1e7..1e14).contains(&limits.copy_bytes_per_second), "{limits:?}");
    assert!((1e-7..1e-1).contains(&limits.submit_seconds), "{limits:?}");
    assert!(limits.dispatch_seconds > 0.0 && limits.dispatch_seconds < 1e-2, "{limits:?}");
}

#[test]
fn a_kernel_that_miscounts_gives_no_limit() {
    let Some(first) = gpu() else { return };
    let short = first.with_shader_edit(|text| text.replace("round = 0u;", "round = 1u;"));
    let problem = short.measure_limits().expect_err("a round is missing").to_string();
    assert!(problem.contains("links instead of"), "{problem}");
    let Some(second) = gpu() else { return };
    let wrong = second.with_shader_edit(|text| text.replace("= source[at]", "= source[at / 2u]"));
    let problem = wrong.measure_limits().expect_err("a wrong copy").to_string();
    assert!(problem.contains("differs from its source"), "{problem}");
}
