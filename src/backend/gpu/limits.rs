//! What an adapter reaches: arithmetic, memory, and what a submission and a dispatch cost.

use std::time::Instant;

use super::attempt::MAX_TRIPS;
use super::batch::Batch;
use super::buffer::Buffer;
use super::call::Call;
use super::compose::{Kernel, Slot, WORKGROUP, limit_kernel};
use super::kernel::Bound;
use super::opened::Opened;
use super::params::Params;
use crate::error::{Fault, Result};

/// Multiplications and additions of one round of `shaders/peak.wgsl`: 16 chains of 4 links of 2.
const ROUND_FLOPS: u64 = 16 * 4 * 2;
/// Links of one round in all chains, and the sum of what the chains start from.
const ROUND_LINKS: u64 = 16 * 4;
const FIRST_SUM: u64 = 120;
/// Threads that multiply and add: several times as many as any GPU keeps resident.
const PEAK_THREADS: u32 = 1 << 20;
/// Bytes that are copied, more than the caches of a GPU hold, where a binding is that large.
const COPY_BYTES: u64 = 128 << 20;
/// Vectors that a thread copies.
const COPY_ROUNDS: u32 = 16;
/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: u64 = 16;
/// Dispatches of one submission.
const DISPATCHES: u64 = 256;
/// A measurement of a rate takes at least this long, so that the submission does not count.
const LONG_ENOUGH_SECONDS: f64 = 0.03;
/// Repetitions, of which the median counts.
const REPETITIONS: usize = 7;

/// What an adapter reaches, as the host sees it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceLimits {
    /// Rate of f32 multiplications and additions in registers, a multiply-add counted as two, 1/s.
    #[serde(with = "crate::files::number")]
    pub flops_per_second: f64,
    /// Rate of a copy between two large buffers, bytes read plus bytes written, 1/s.
    #[serde(with = "crate::files::number")]
    pub copy_bytes_per_second: f64,
    /// An empty submission and the wait for it, s.
    #[serde(with = "crate::files::number")]
    pub submit_seconds: f64,
    /// One more dispatch in a submission, each waiting for the one before, s.
    #[serde(with = "crate::files::number")]
    pub dispatch_seconds: f64,
}

/// See [`super::Gpu::measure_limits`].
pub(super) fn measure(opened: &Opened) -> Result<DeviceLimits> {
    let call = Call::new(opened, DISPATCHES);
    Ok(DeviceLimits {
        flops_per_second: flops(&call)?,
        copy_bytes_per_second: copied_bytes(&call, copy_threads(opened))?,
        submit_seconds: median_seconds(&call, &Batch::default())?,
        dispatch_seconds: dispatch_seconds(&call)?,
    })
}

/// Rate of multiply-adds: as many rounds as take long enough.
fn flops(call: &Call<'_>) -> Result<f64> {
    let sink = call.storage(4 * u64::from(PEAK_THREADS));
    let peak = bind(call, Kernel::Peak, [&sink, &sink])?;
    let mut rounds = 16;
    loop {
        let params = Params { rounds, temperature: 1.0, ..Params::default() };
        let mut batch = Batch::default();
        batch.push(&peak, &params, [PEAK_THREADS / WORKGROUP, 1]);
        let seconds = median_seconds(call, &batch)?;
        check_peak(call, &sink, rounds)?;
        if seconds >= LONG_ENOUGH_SECONDS || 4 * u64::from(rounds) > MAX_TRIPS {
            let flops = u64::from(PEAK_THREADS) * u64::from(rounds) * ROUND_FLOPS;
            return Ok(flops as f64 / seconds);
        }
        rounds *= 4;
    }
}

/// Whether every chain has all its links.
fn check_peak(call: &Call<'_>, sink: &Buffer, rounds: u32) -> Result<()> {
    let sums: Vec<f32> = sink.read(call.device(), PEAK_THREADS as usize)?;
    let expected = (FIRST_SUM + ROUND_LINKS * u64::from(rounds)) as f32;
    match sums.iter().find(|sum| **sum != expected) {
        None => Ok(()),
        Some(wrong) => Err(call.device().failed(
            Fault::Validation,
            &format!(
                "the kernel that measures arithmetic counted {wrong} links instead of {expected}"
            ),
        )),
    }
}

/// Threads of the copy: as many as the buffers that the adapter allows have vectors for.
fn copy_threads(opened: &Opened) -> u32 {
    let adapter = &opened.device.adapter;
    let bytes = COPY_BYTES.min(adapter.max_binding_bytes).min(adapter.max_buffer_bytes);
    let threads = bytes / (VECTOR_BYTES * u64::from(COPY_ROUNDS));
    (threads / u64::from(WORKGROUP) * u64::from(WORKGROUP)) as u32
}

/// Rate of a copy by `threads` threads: as many copies as take long enough.
fn copied_bytes(call: &Call<'_>, threads: u32) -> Result<f64> {
    let vectors = threads * COPY_ROUNDS;
    let bytes = VECTOR_BYTES * u64::from(vectors);
    let [source, sink] = [(); 2].map(|()| call.storage(bytes));
    let numbers: Vec<[u32; 4]> = (0..vectors).map(|i| [i, !i, i ^ 1, 0]).collect();
    source.write(call.device(), &numbers);
    let copy = bind(call, Kernel::Copy, [&source, &sink])?;
    let params = Params { rounds: COPY_ROUNDS, stride: threads, ..Params::default() };
    let mut copies = 1;
    loop {
        let mut batch = Batch::default();
        for _ in 0..copies {
            batch.push(&copy, &params, [threads / WORKGROUP, 1]);
        }
        let seconds = median_seconds(call, &batch)?;
        if seconds >= LONG_ENOUGH_SECONDS || 4 * copies > DISPATCHES {
            if sink.read::<[u32; 4]>(call.device(), vectors as usize)? != numbers {
                let problem = "a copied buffer differs from its source";
                return Err(call.device().failed(Fault::Validation, problem));
            }
            return Ok((2 * bytes * copies) as f64 / seconds);
        }
        copies *= 4;
    }
}

/// What each of many smallest dispatches adds, each of which writes what the one before wrote.
fn dispatch_seconds(call: &Call<'_>) -> Result<f64> {
    let sink = call.storage(4 * u64::from(WORKGROUP));
    let peak = bind(call, Kernel::Peak, [&sink, &sink])?;
    let of = |dispatches: u64| {
        let mut batch = Batch::default();
        for _ in 0..dispatches {
            batch.push(&peak, &Params::default(), [1, 1]);
        }
        median_seconds(call, &batch)
    };
    Ok((of(DISPATCHES)? - of(1)?).max(0.0) / (DISPATCHES - 1) as f64)
}

fn bind(call: &Call<'_>, kernel: Kernel, [source, sink]: [&Buffer; 2]) -> Result<Bound> {
    let (text, bindings) = (limit_kernel(kernel), kernel.bindings(false));
    call.bind(kernel, bindings, text, |slot| if slot == Slot::Source { source } else { sink })
}

/// Median time of submitting `batch` and waiting for it, after a first time that does not count.
fn median_seconds(call: &Call<'_>, batch: &Batch<'_>) -> Result<f64> {
    let run = || {
        let begin = Instant::now();
        call.submit(batch)?;
        call.device().wait(None)?;
        Ok(begin.elapsed().as_secs_f64())
    };
    run()?;
    let mut seconds = (0..REPETITIONS).map(|_| run()).collect::<Result<Vec<f64>>>()?;
    seconds.sort_by(f64::total_cmp);
    Ok(seconds[REPETITIONS / 2])
}
