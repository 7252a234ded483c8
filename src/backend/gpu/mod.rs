//! The GPU backend: recorded physics spliced into the WGSL kernels, run through wgpu.

mod buffer;
mod cache;
pub mod compose;
mod deviation;
mod device;
mod drive;
mod kernel;
mod limits;
mod mppi;
mod mppi_plan;
mod network;
mod plan;
mod reach_avoid;
mod run;
mod timing;

use std::fmt;
use std::sync::Arc;

use super::{MeasureSink, PairSink};
use crate::cost::Cost;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{DeviationTask, Farthest, MppiResult, MppiTask, Plant, ReachAvoidTask};
use crate::system::System;

use buffer::Pool;
use device::Device;
use kernel::Pipelines;
use timing::Clock;

pub use buffer::Params;
pub use device::{Adapter, AdapterKind, Choice, adapters};
pub use limits::DeviceLimits;
pub use plan::NetworkKernels;
pub use timing::KernelTime;

/// An opened adapter with its pipelines and buffers.
pub struct Gpu {
    device: Device,
    pipelines: Pipelines,
    pool: Pool,
    clock: Clock,
    networks: NetworkKernels,
}

impl Gpu {
    /// Opens an adapter. Where its driver allows, compiled kernels are kept in the user's folder
    /// for caches, or in the folder that `REACHCAST_PIPELINE_CACHE` names; `off` keeps none.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if none fits the choice or it does not open; it names those found.
    pub fn open(choice: &Choice) -> Result<Self> {
        let device = Device::open(choice)?;
        Ok(Self {
            pipelines: Pipelines::new(&device),
            device,
            pool: Pool::default(),
            clock: Clock::default(),
            networks: NetworkKernels::Chosen,
        })
    }

    /// The same adapter, with the text of every kernel changed by `edit` before it is compiled.
    ///
    /// For tests that must fail: a comparison that does not notice a changed kernel proves
    /// nothing.
    #[doc(hidden)]
    #[must_use]
    pub fn with_shader_edit(
        mut self,
        edit: impl Fn(&str) -> String + Send + Sync + 'static,
    ) -> Self {
        self.pipelines = Pipelines::edited(Arc::new(edit));
        self
    }

    /// The same adapter, whose rollouts run networks as `networks` says.
    #[must_use]
    pub fn with_networks(mut self, networks: NetworkKernels) -> Self {
        self.networks = networks;
        self
    }

    /// Times every dispatch on the device from now on, or no longer; off at first.
    ///
    /// Timed dispatches run in a pass each, and the host waits for each submission. On an adapter
    /// without timestamp queries nothing changes.
    pub fn time_kernels(&self, on: bool) {
        self.clock.switch(on);
    }

    /// Times since the last call, by kernel, in the order in which they first ran; empty where
    /// nothing was timed.
    pub fn take_kernel_times(&self) -> Vec<KernelTime> {
        self.clock.take()
    }

    /// Measures what the adapter can do; takes a second or so, more on a software adapter.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if a kernel fails or leaves wrong results.
    pub fn measure_limits(&self) -> Result<DeviceLimits> {
        limits::measure(self)
    }

    /// The adapter in figures.
    pub fn adapter(&self) -> &Adapter {
        &self.device.adapter
    }

    /// The adapter in words: name, interface, kind and driver.
    pub fn device(&self) -> String {
        self.device.adapter.to_string()
    }

    /// See [`super::Backend::reach_avoid`].
    pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &ReachAvoidTask<'_, NX>,
        sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        reach_avoid::reach_avoid(self, plant, task, sink)
    }

    /// See [`super::Backend::deviation`].
    pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &DeviationTask<'_, NX>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        deviation::deviation(self, plant, task, sink)
    }

    /// See [`super::Backend::mppi`].
    pub(super) fn mppi<S, C, const NX: usize, const NU: usize, const NC: usize>(
        &self,
        system: &S,
        cost: &C,
        task: &MppiTask<'_, NX, NU, NC>,
    ) -> Result<Vec<MppiResult<NU>>>
    where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        mppi::mppi(self, system, cost, task)
    }
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Gpu").field(&self.device.adapter).finish()
    }
}
