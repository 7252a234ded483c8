//! Batches of growing size in one process: time should grow linearly, memory not at all.

use std::hint::black_box;
use std::path::Path;

use super::measure::{Protocol, measure};
use super::record::ScalingRecord;
use super::workload::Batch;
use crate::backend::{Backend, Program};
use crate::error::Result;
use crate::files::{CONFIG_BYTES, read_text};
use crate::rollout::{Query, ReachAvoidTask, Starts, Tightening};
use crate::scenario::{Unwatched, Watch};

/// Sizes of the batches.
pub const SIZES: [u64; 4] = [10_000, 100_000, 1_000_000, 10_000_000];

/// Rolls out the batches of `sizes`, one after the other.
///
/// # Errors
/// Those of the backend, and interruption.
pub fn scaling(
    backend: &Backend,
    batch: &Batch,
    sizes: &[u64],
    protocol: &Protocol,
    watch: &dyn Watch,
) -> Result<Vec<ScalingRecord>> {
    let program = backend.prepare(&batch.plant)?;
    // Compiles the kernels, which no later batch does.
    roll(&program, batch, 1, &Unwatched)?;
    let timed = |&rollouts: &u64| {
        reset_peak();
        watch.begin(&format!("{rollouts} rollouts"), rollouts);
        let timing = measure(protocol, || roll(&program, batch, rollouts, watch))?;
        Ok(ScalingRecord {
            backend: backend.name().to_owned(),
            rollouts,
            timing,
            rollouts_per_second: rollouts as f64 / timing.median_seconds,
            peak_bytes: peak_bytes(),
        })
    };
    sizes.iter().map(timed).collect()
}

/// Rolls out the first `count` starts of `batch`.
fn roll(program: &Program<'_>, batch: &Batch, count: u64, watch: &dyn Watch) -> Result<()> {
    let Batch { region, stream, spec, .. } = batch;
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region: region.clone(), stream: *stream },
        range: 0..count,
        spec: *spec,
        tightening: &Tightening::none(spec),
        query: Query::Measure,
    };
    program.reach_avoid(&task, &mut |_, measures| {
        black_box(measures);
        watch.advance(measures.len() as u64)
    })
}

/// Starts the count of [`peak_bytes`] anew, where the system lets a process do that (Linux).
/// Elsewhere it goes on from the start of the process, which hides no growth.
fn reset_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Most memory that the process held since the last reset, bytes; where the system tells.
fn peak_bytes() -> Option<u64> {
    let status = read_text(Path::new("/proc/self/status"), CONFIG_BYTES).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kibibytes| kibibytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_sees_what_was_held() {
        reset_peak();
        let before = peak_bytes().unwrap();
        let held = std::hint::black_box(vec![1_u8; 256 << 20]);
        let during = peak_bytes().unwrap();
        drop(held);
        // Half of it: other tests of the same process give memory back.
        assert!(during >= before + (128 << 20), "{before} to {during}");
    }
}
