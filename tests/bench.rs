//! The command `bench` from outside: its record, its refusals, and what it exports. No time is judged.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod command;
mod common;

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;

use command::{done, refused};
use reachcast::bench::record::{BENCH_SCHEMA, BenchRecord};
use reachcast::files::npy_bytes;
use reachcast::policy::Mlp;

/// The record of the smallest rollouts, measured once.
fn smallest() -> &'static BenchRecord {
    static RECORD: OnceLock<BenchRecord> = OnceLock::new();
    RECORD.get_or_init(|| record("/158"))
}

/// The record of a quick benchmark on the CPU.
fn record(filter: &str) -> BenchRecord {
    let words = ["bench", "--quick", "--backend", "cpu", "--threads", "2", "--json", "--workload"];
    serde_json::from_str(&done(&[&words[..], &[filter]].concat())).unwrap()
}

#[test]
fn every_field_of_the_record_makes_sense() {
    let record = smallest();
    assert_eq!((record.schema, record.seed), (BENCH_SCHEMA, 1));
    assert_eq!(record.version, env!("CARGO_PKG_VERSION"));
    assert_eq!(record.machine.threads, 2);
    assert!(record.machine.cores > 0 && !record.machine.cpu.is_empty());
    assert!(record.backends[0].device.contains(&record.machine.instructions));
    assert_eq!((record.backends.len(), &record.backends[0].adapter), (1, &None));
    let limits = &record.limits;
    for limit in [limits.gemm_one_flops, limits.gemm_all_flops, limits.triad_bytes] {
        assert!(limit > 0.0, "{limits:?}");
    }
    let names: Vec<&str> = record.workloads.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["rollout/3x64/158", "rollout/3x128/158", "rollout/4x512/158"]);
    for one in &record.workloads {
        let timing = &one.timing;
        assert!(timing.calls > 0 && timing.best_seconds > 0.0, "{one:?}");
        assert!(timing.best_seconds <= timing.p10_seconds, "{one:?}");
        assert!(timing.p10_seconds <= timing.median_seconds, "{one:?}");
        assert!(timing.median_seconds <= timing.p90_seconds, "{one:?}");
        let rate = 158.0 / timing.median_seconds;
        assert!((one.units_per_second / rate - 1.0).abs() < 1e-9, "{one:?}");
        assert!((one.steps_per_second / (30.0 * rate) - 1.0).abs() < 1e-9, "{one:?}");
        // Above one only as far as others slow the machine down while its limit is measured.
        assert!(one.share > 0.0 && one.share < 20.0, "{one:?}");
    }
    assert!(record.scaling.is_empty() && record.left_out.is_empty() && record.to_come.is_empty());
}

/// Killed after its first workload: what it measured is there, and what it did not is named.
#[test]
fn a_killed_benchmark_leaves_what_it_measured() {
    let folder = tempfile::tempdir().unwrap();
    let stored = folder.path().join("bench.json");
    let mut program = Command::new(env!("CARGO_BIN_EXE_reachcast"))
        .args(["bench", "--backend", "cpu", "--threads", "2", "-q", "--workload", "/158", "--out"])
        .arg(folder.path())
        .spawn()
        .unwrap();
    while !stored.exists() {
        assert!(program.try_wait().unwrap().is_none(), "it ended without a record");
        std::thread::sleep(Duration::from_millis(5));
    }
    program.kill().unwrap();
    program.wait().unwrap();
    let record: BenchRecord =
        serde_json::from_str(&std::fs::read_to_string(stored).unwrap()).unwrap();
    let names: Vec<&str> = record.workloads.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["rollout/3x64/158"]);
    assert!(record.workloads[0].share > 0.0, "{:?}", record.workloads[0]);
    assert_eq!(record.to_come, ["rollout/3x128/158 on cpu", "rollout/4x512/158 on cpu"]);
}

/// By hand, per step: two operations per weight and 40 of the physics, of which 5 multiply parameters;
/// per state 32 of the margins and 8 of the fold.
#[test]
fn operations_are_those_of_the_hand_count() {
    let states = 31.0 * 40.0;
    let weights = [
        12.0 * 64.0 + 2.0 * 64.0 * 64.0 + 64.0 * 3.0,
        12.0 * 128.0 + 2.0 * 128.0 * 128.0 + 128.0 * 3.0,
        12.0 * 512.0 + 3.0 * 512.0 * 512.0 + 512.0 * 3.0,
    ];
    let record = smallest();
    for (one, weights) in record.workloads.iter().zip(weights) {
        assert_eq!(one.flops_per_unit, 30.0 * (2.0 * weights + 40.0) + states, "{}", one.name);
    }
}

#[test]
fn batches_grow_and_memory_does_not() {
    let record = record("scaling");
    assert!(record.workloads.is_empty());
    let sizes: Vec<u64> = record.scaling.iter().map(|one| one.rollouts).collect();
    assert_eq!(sizes, [10_000, 100_000]);
    let peaks: Vec<_> = record.scaling.iter().map(|one| one.peak_bytes).collect();
    if let [Some(small), Some(large)] = peaks[..] {
        // The largest chunk of results is a quarter of a MiB.
        assert!(large < small + (4 << 20), "{peaks:?}");
    } else if cfg!(target_os = "linux") {
        panic!("the peak is unknown: {peaks:?}");
    }
}

#[test]
fn a_filter_that_fits_nothing_is_refused_with_what_there_is() {
    let words = ["--workload nonsense", "rollout/3x64/158", "sign/race/65536", "scaling"];
    refused(&["bench", "--quick", "--workload", "nonsense"], &words);
    refused(&["bench", "--quick", "--export", "nowhere"], &["--export"]);
}

#[test]
fn the_record_goes_to_the_folder_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let words =
        ["bench", "--quick", "--backend", "cpu", "--workload", "mppi/lane/1024", "--out", out];
    let page = done(&words);
    for word in ["machine", "method", "limits", "mppi/lane/1024", "cpu"] {
        assert!(page.contains(word), "no `{word}` in: {page}");
    }
    let stored = std::fs::read_to_string(folder.path().join("bench.json")).unwrap();
    let record: BenchRecord = serde_json::from_str(&stored).unwrap();
    assert_eq!((record.workloads.len(), record.workloads[0].steps_per_unit), (1, 20.0));
}

/// A software adapter gets the small workloads, and the others are named with the reason.
#[test]
fn an_adapter_is_measured_and_large_work_left_out() {
    let Some(gpu) = common::adapter() else { return };
    let words = ["bench", "--quick", "--backend", "gpu", "--json", "--workload", "rollout/3x64"];
    let record: BenchRecord = serde_json::from_str(&done(&words)).unwrap();
    assert_eq!(record.backends.len(), 1);
    assert_eq!(record.backends[0].device, gpu.device());
    let adapter = record.backends[0].adapter.unwrap();
    assert!(adapter.round_trip.median_seconds > 0.0);
    let limits = &adapter.device;
    let rates = [limits.flops_per_second, limits.copy_bytes_per_second];
    assert!(rates.iter().all(|rate| *rate > 1e6), "{limits:?}");
    assert!(limits.submit_seconds > 0.0 && limits.dispatch_seconds > 0.0, "{limits:?}");
    for one in &record.workloads {
        let device: f64 = one.kernels.iter().map(|kernel| kernel.seconds).sum();
        assert!(one.kernels.iter().all(|kernel| kernel.dispatches > 0), "{one:?}");
        assert!(one.kernels.is_empty() || device > 0.0, "{one:?}");
    }
    assert!(record.workloads.iter().all(|one| one.backend == "gpu"));
    assert_eq!(record.workloads.len() + record.left_out.len(), 3);
    assert_eq!(record.workloads[0].name, "rollout/3x64/158");
}

/// Exported starts that are rolled out again; of the largest network all of them would take half a minute.
const FIRST: usize = 1024;

/// The numbers of a .npy file.
fn npy(path: &Path) -> (Vec<u64>, Vec<f32>) {
    let file = std::fs::read(path).unwrap();
    let file = npyz::NpyFile::new(file.as_slice()).unwrap();
    (file.shape().to_vec(), file.into_vec().unwrap())
}

/// One export, since its largest network takes a while.
#[test]
fn exports_are_what_the_program_computes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    done(&["bench", "--export", out, "--backend", "cpu", "--seed", "7"]);
    exported_measures_are_those_of_the_command_rollout(folder.path());
    the_exported_plan_follows_from_controls_and_costs(folder.path());
}

fn exported_measures_are_those_of_the_command_rollout(folder: &Path) {
    let path = |name: &str| folder.join(name);
    let settings = std::fs::read_to_string(path("settings.json")).unwrap();
    let settings: serde_json::Value = serde_json::from_str(&settings).unwrap();
    assert_eq!((&settings["horizon"], &settings["mppi"]["horizon"]), (&30.into(), &20.into()));
    let (shape, starts) = npy(&path("starts.npy"));
    assert_eq!((shape, starts.len()), (vec![65_536, 12], 65_536 * 12));
    let first = path("first.npy");
    std::fs::write(&first, npy_bytes(&starts[..FIRST * 12], [FIRST, 12])).unwrap();
    for (name, parameters) in
        [("3x64", 9347), ("3x128", 35_075), ("4x512", 796_163), ("race", 9347)]
    {
        let network = path(&format!("{name}.safetensors"));
        assert_eq!(Mlp::load(&network).unwrap().parameter_count(), parameters, "{name}");
        let (shape, exported) = npy(&path(&format!("{name}_measures.npy")));
        assert_eq!(shape, [4096, 1]);
        let config = path("config.toml");
        let file = network.to_str().unwrap();
        std::fs::write(&config, format!("system.name = 'drone-race'\npolicy.file = '{file}'\n"))
            .unwrap();
        let (config, measures) = (config.to_str().unwrap(), path("measures.npy"));
        let files = ["--starts", first.to_str().unwrap(), "--measures"];
        let words = ["rollout", config, "--backend", "cpu", "-q", "--overwrite"];
        done(&[&words[..], &files, &[measures.to_str().unwrap()]].concat());
        let (_, ours) = npy(&measures);
        assert_eq!(exported[..FIRST], ours[..], "{name}");
        let successes = exported.iter().filter(|measure| **measure > 0.0).count();
        assert!(successes < 4096, "{name}: {successes} successes");
    }
}

/// The exported plan is the mean of the controls, weighted by the exponentials of the costs.
fn the_exported_plan_follows_from_controls_and_costs(folder: &Path) {
    let read = |name: &str| npy(&folder.join(name));
    let (shape, controls) = read("mppi_controls.npy");
    assert_eq!(shape, [1024, 60]);
    assert!(controls.iter().all(|u| (-1.0..=1.0).contains(u)));
    let (_, costs) = read("mppi_costs.npy");
    let (shape, plan) = read("mppi_plan.npy");
    assert_eq!(shape, [20, 3]);
    let least = costs.iter().copied().fold(f32::INFINITY, f32::min);
    let weight = |cost: &f32| (-f64::from(cost - least) / 10.0).exp();
    let weights: Vec<f64> = costs.iter().map(weight).collect();
    let total: f64 = weights.iter().sum();
    for (i, u) in plan.iter().enumerate() {
        let sum: f64 =
            weights.iter().zip(controls.chunks(60)).map(|(w, row)| w * f64::from(row[i])).sum();
        assert!((sum / total - f64::from(*u)).abs() < 1e-4, "{i}: {} and {u}", sum / total);
    }
}
