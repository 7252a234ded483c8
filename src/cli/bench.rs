//! The command `bench`: this machine's limits, and how near the workloads come to them.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use super::args::BenchArguments;
use super::options::Global;
use super::progress::Progress;
use super::{Outcome, devices, document, report};
use crate::bench::measure::Timing;
use crate::bench::record::{BenchRecord, KernelRecord, ScalingRecord, WorkloadRecord};
use crate::bench::run::{self as benchmark, Asked};
use crate::error::Result;
use crate::files::{Staged, check_room, json, spare_existing, spare_results};
use crate::studies;

/// Room for the record, bytes.
const RECORD_BYTES: u64 = 1 << 20;
/// Name of the record.
const RECORD: &str = "bench.json";
/// Seed unless `--seed` says otherwise.
const SEED: u64 = 1;

/// Measures, or exports what is measured.
pub(super) fn run(global: &Global, asked: &BenchArguments) -> Result<Outcome> {
    let seed = global.changes.seed.unwrap_or(SEED);
    if let Some(folder) = &asked.export {
        return write_out(global, seed, folder);
    }
    let threads = global.common.threads.map(usize::from);
    let asked = Asked { quick: asked.quick, filter: asked.workload.clone(), seed, threads };
    let progress = Progress::new(global);
    if let Some(out) = &global.out {
        spare_results(out)?;
        spare_existing(&out.join(RECORD), global.existing)?;
    }
    // Before the work: a folder that cannot be written to would waste it.
    let staged = global.out.as_deref().map(Staged::new).transpose()?;
    global.out.as_deref().map_or(Ok(()), |out| check_room(out, RECORD_BYTES))?;
    let backends = devices::all(global)?;
    let mut note = |record: &BenchRecord| match &global.out {
        Some(out) => publish(record, Staged::new(out)?),
        None => Ok(()),
    };
    let record = benchmark::run(&asked, studies::work(seed)?, &backends, &progress, &mut note)?;
    progress.finish();
    backends.iter().for_each(|backend| devices::note_events(global, backend));
    if let Some(staged) = staged {
        publish(&record, staged)?;
    }
    report(global, &record, || text(&record))?;
    Ok(Outcome::Done)
}

/// Writes the record, in the place of one that said less.
fn publish(record: &BenchRecord, mut staged: Staged) -> Result<()> {
    staged.add(RECORD, json(RECORD, record)?.as_bytes())?;
    staged.publish().map(drop)
}

/// What `bench --export --json` prints.
#[derive(Serialize)]
struct Exported {
    seed: u64,
    files: Vec<String>,
}

/// Writes what the workloads run on.
fn write_out(global: &Global, seed: u64, folder: &Path) -> Result<Outcome> {
    spare_results(folder)?;
    let files = studies::export(&devices::open(global)?, seed, folder, global.existing)?;
    let files = files.iter().map(|file| file.display().to_string()).collect();
    let exported = Exported { seed, files };
    let lines = || exported.files.iter().map(|file| format!("{file}\n")).collect();
    report(global, &document(&exported), lines)?;
    Ok(Outcome::Done)
}

/// The record as a page of text.
fn text(record: &BenchRecord) -> String {
    let mut text = head(record);
    if !record.workloads.is_empty() {
        // A String takes whatever is written to it.
        let _ = writeln!(
            text,
            "\n{:26} {:7} {:>12}  {:25} {:>6} {:>12} {:>9} {:>7}",
            "workload",
            "backend",
            "units/s",
            "  10 % to 90 % of calls",
            "calls",
            "steps/s",
            "GFLOP/s",
            "share"
        );
        text.extend(record.workloads.iter().map(workload_line));
    }
    if !record.scaling.is_empty() {
        let _ = writeln!(
            text,
            "\n{:26} {:7} {:>12} {:>12} {:>14}",
            "rollouts N (scaling)", "backend", "seconds", "rollouts/s", "peak memory"
        );
        text.extend(record.scaling.iter().map(scaling_line));
    }
    for left_out in &record.left_out {
        let (name, backend, reason) = (&left_out.name, &left_out.backend, &left_out.reason);
        let _ = writeln!(text, "left out on {backend}: {name} ({reason})");
    }
    if !record.to_come.is_empty() {
        let _ = writeln!(text, "interrupted before: {}", record.to_come.join(", "));
    }
    text
}

/// Machine, protocol and limits.
fn head(record: &BenchRecord) -> String {
    let BenchRecord { machine, protocol, limits, .. } = record;
    let mut text = format!(
        "machine  {}, {} cores, {}, {}; reachcast {}, seed {}\n\
         method   {} s of warm-up, then calls for {} s, {} at least; rates at the median call; \
         share: best call over best matrix products (CPU), over \
         multiply-adds in registers (GPU)\n\
         limits   f32 matrix products {} GFLOP/s on one thread, {} on {}; \
         memory {:.1} GB/s (a = b + s c)\n",
        machine.cpu,
        machine.cores,
        machine.instructions,
        machine.platform,
        record.version,
        record.seed,
        protocol.warm_up_seconds,
        protocol.budget_seconds,
        protocol.least_calls,
        giga(limits.gemm_one_flops),
        giga(limits.gemm_all_flops),
        limits.threads,
        limits.triad_bytes / 1e9
    );
    for backend in &record.backends {
        let _ = write!(text, "{:8} {}", backend.backend, backend.device);
        if let Some(adapter) = &backend.adapter {
            let [low, middle, high] = spread(&adapter.round_trip).map(|seconds| 1e6 * seconds);
            let _ = write!(text, "; there and back {middle:.0} us ({low:.0} to {high:.0})");
            let device = &adapter.device;
            let _ = write!(
                text,
                "\n         multiply-adds {} GFLOP/s, copies {:.1} GB/s, a submission {:.1} us, a further \
                 dispatch {:.1} us",
                giga(device.flops_per_second),
                device.copy_bytes_per_second / 1e9,
                1e6 * device.submit_seconds,
                1e6 * device.dispatch_seconds
            );
        }
        text.push('\n');
    }
    text
}

/// The times of which the median, a tenth below and a tenth above are reported, shortest first.
fn spread(timing: &Timing) -> [f64; 3] {
    [timing.p10_seconds, timing.median_seconds, timing.p90_seconds]
}

fn workload_line(workload: &WorkloadRecord) -> String {
    let units = workload.units as f64;
    let [high, middle, low] = spread(&workload.timing).map(|seconds| count(units / seconds));
    let between = format!("{low} to {high}");
    format!(
        "{:26} {:7} {middle:>12}  {between:25} {:>6} {:>12} {:>9} {:>7}\n",
        workload.name,
        workload.backend,
        workload.timing.calls,
        count(workload.steps_per_second),
        giga(workload.flops_per_second),
        format!("{:.1} %", 100.0 * workload.share),
    ) + &workload.kernels.iter().map(kernel_line).collect::<String>()
}

/// Time of a kernel on the adapter.
fn kernel_line(kernel: &KernelRecord) -> String {
    let KernelRecord { kernel, dispatches, seconds } = kernel;
    format!("    {kernel:22} {:.3} ms on the adapter in {dispatches} dispatches\n", 1e3 * seconds)
}

fn scaling_line(scaling: &ScalingRecord) -> String {
    let peak = scaling.peak_bytes.map(|bytes| format!("{:.0} MiB", bytes as f64 / 1048576.0));
    format!(
        "{:26} {:7} {:>12.4} {:>12} {:>14}\n",
        scaling.rollouts,
        scaling.backend,
        scaling.timing.median_seconds,
        count(scaling.rollouts_per_second),
        peak.unwrap_or("unknown".to_owned())
    )
}

/// A rate with three digits or more.
fn count(rate: f64) -> String {
    match rate {
        1e6.. => format!("{:.2} M", rate / 1e6),
        1e4.. => format!("{:.1} k", rate / 1e3),
        _ => format!("{rate:.0}"),
    }
}

/// A rate in thousands of millions.
fn giga(rate: f64) -> String {
    format!("{:.1}", rate / 1e9)
}
