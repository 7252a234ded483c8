//! Time that each kernel takes on the device, where the adapter has a clock to read.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use super::buffer::{Buffer, Pool, Use};
use super::device::Device;
use crate::error::Result;

/// Dispatches that one set of queries times, two queries each: the most that wgpu allows.
const SET_DISPATCHES: usize = 2048;

/// Time of all dispatches of one kernel.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct KernelTime {
    /// Entry point of the kernel, which is the stem of its file in `shaders/`.
    pub kernel: &'static str,
    /// Dispatches that were timed.
    pub dispatches: u64,
    /// Time on the device from the end of what came before each to its own end, summed, s.
    #[serde(with = "crate::files::number")]
    pub seconds: f64,
}

/// Sums of the dispatches of an adapter, while it is switched on.
#[derive(Default)]
pub(super) struct Clock {
    on: AtomicBool,
    times: Mutex<Vec<KernelTime>>,
}

impl Clock {
    /// Times the submissions from now on, or no longer.
    pub(super) fn switch(&self, on: bool) {
        self.on.store(on, Ordering::Relaxed);
    }

    /// The sums since the last call, in the order in which their kernels first ran.
    pub(super) fn take(&self) -> Vec<KernelTime> {
        std::mem::take(&mut self.times.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Queries for a submission of `dispatches` dispatches; `None` while nothing is to be timed.
    pub(super) fn stamps(&self, device: &Device, pool: &Pool, dispatches: usize) -> Option<Stamps> {
        let has_clock = device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        if !has_clock || !self.on.load(Ordering::Relaxed) {
            return None;
        }
        let sizes = (0..dispatches).step_by(SET_DISPATCHES);
        let sets = sizes.map(|at| Set::new(device, pool, SET_DISPATCHES.min(dispatches - at)));
        Some(Stamps { sets: sets.collect() })
    }

    /// Adds the times of a submission, once it is done, to the sums of its kernels.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn add(
        &self,
        device: &Device,
        stamps: &Stamps,
        kernels: impl Iterator<Item = &'static str>,
    ) -> Result<()> {
        let ticks = stamps.read(device)?;
        let tick_seconds = 1e-9 * f64::from(device.queue.get_timestamp_period());
        let mut times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        for (kernel, [begin, end]) in kernels.zip(ticks) {
            let seconds = tick_seconds * end.saturating_sub(begin) as f64;
            match times.iter_mut().find(|time| time.kernel == kernel) {
                Some(time) => {
                    time.dispatches += 1;
                    time.seconds += seconds;
                }
                None => times.push(KernelTime { kernel, dispatches: 1, seconds }),
            }
        }
        Ok(())
    }
}

/// The queries of one submission.
pub(super) struct Stamps {
    sets: Vec<Set>,
}

impl Stamps {
    /// The pass of dispatch number `dispatch`, with its two times.
    pub(super) fn pass(&self, dispatch: usize) -> wgpu::ComputePassDescriptor<'_> {
        let begin = 2 * (dispatch % SET_DISPATCHES) as u32;
        wgpu::ComputePassDescriptor {
            label: None,
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &self.sets[dispatch / SET_DISPATCHES].queries,
                beginning_of_pass_write_index: Some(begin),
                end_of_pass_write_index: Some(begin + 1),
            }),
        }
    }

    /// Collects the times at the end of `encoder`.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        for Set { queries, ticks } in &self.sets {
            encoder.resolve_query_set(queries, 0..queries.count(), ticks.whole(), 0);
        }
    }

    /// Begin and end of each dispatch, ticks.
    fn read(&self, device: &Device) -> Result<Vec<[u64; 2]>> {
        let read = |set: &Set| set.ticks.read(device, set.queries.count() as usize / 2);
        Ok(self.sets.iter().map(read).collect::<Result<Vec<_>>>()?.concat())
    }
}

/// Queries, and the buffer that their times go to.
struct Set {
    queries: wgpu::QuerySet,
    ticks: Buffer,
}

impl Set {
    fn new(device: &Device, pool: &Pool, dispatches: usize) -> Self {
        let count = 2 * dispatches as u32;
        let queries = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        let bytes = u64::from(count * wgpu::QUERY_SIZE);
        Self { queries, ticks: pool.take(device, Use::Timestamps, bytes) }
    }
}
