//! The GPU backend: recorded physics spliced into the WGSL kernels, run through wgpu.

mod buffer;
mod cache;
pub mod compose;
mod deviation;
mod device;
mod drive;
mod fault;
mod kernel;
#[cfg(feature = "train-gpu")]
mod lent;
mod limits;
mod mppi;
mod mppi_plan;
mod network;
mod opened;
mod plan;
mod prepared;
mod reach_avoid;
mod recover;
mod run;
mod timing;

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::cpu::Cpu;
use super::{Event, MeasureSink, PairSink};
use crate::cost::Cost;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{DeviationTask, Farthest, MppiResult, MppiTask, Plant, ReachAvoidTask};
use crate::system::System;

use opened::{Opened, Setup};
use recover::State;

pub use buffer::Params;
#[cfg(feature = "train")]
pub(crate) use device::contained;
pub use device::{Adapter, AdapterKind, Choice, adapters};
pub use fault::Injection;
pub use limits::DeviceLimits;
pub use plan::NetworkKernels;
pub(super) use prepared::Prepared;
pub use timing::KernelTime;

/// An adapter, and what becomes of the work where it fails.
///
/// Out of memory, or over time, it goes on in chunks of half the size, down to a smallest one. A
/// device that is lost is opened again, once. After that, and where a driver refuses what it is
/// given, the rest is for the CPU if that was allowed, and an error if not.
pub struct Gpu {
    adapter: Adapter,
    setup: Setup,
    state: Mutex<State>,
    fallback: Option<Cpu>,
    events: Mutex<Vec<Event>>,
}

impl Gpu {
    /// Opens an adapter. Where its driver allows, compiled kernels are kept in the user's folder
    /// for caches, or in the folder that `REACHCAST_PIPELINE_CACHE` names; `off` keeps none.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if none fits the choice or it does not open; it names those found.
    pub fn open(choice: &Choice) -> Result<Self> {
        let device = device::Device::open(choice)?;
        let setup = Setup::default();
        Ok(Self {
            adapter: device.adapter.clone(),
            state: Mutex::new(State::new(Opened::new(device, setup.clone()))),
            setup,
            fallback: None,
            events: Mutex::default(),
        })
    }

    /// The same adapter, whose work goes on on `cpu` where it fails for good.
    #[must_use]
    pub fn with_fallback(self, cpu: Cpu) -> Self {
        Self { fallback: Some(cpu), ..self }
    }

    /// The same adapter, opened once more for a library with kernels of its own.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if it is gone or does not open.
    #[cfg(feature = "train-gpu")]
    pub(crate) fn lend(&self) -> Result<lent::Lent> {
        lent::Lent::open(&self.adapter)
    }

    /// What failed so far and was worked around, in order.
    pub fn events(&self) -> Vec<Event> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).clone()
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
        self.setup.edit = Some(Arc::new(edit));
        let opened = Opened::new(self.opened().device.clone(), self.setup.clone());
        self.with_opened(opened)
    }

    /// The same adapter, whose rollouts run networks as `networks` says.
    #[must_use]
    pub fn with_networks(mut self, networks: NetworkKernels) -> Self {
        self.setup.networks = networks;
        let opened = Opened { setup: self.setup.clone(), ..self.opened().changed(|device| device) };
        self.with_opened(opened)
    }

    /// The same adapter, which fails as `asked`; for tests of what becomes of the work.
    #[doc(hidden)]
    #[must_use]
    pub fn with_failures(self, asked: Vec<Injection>) -> Self {
        let opened = self.opened().changed(|device| device.failing(asked));
        self.with_opened(opened)
    }

    /// The same adapter, where work may take no longer than `patience`; for tests.
    #[doc(hidden)]
    #[must_use]
    pub fn with_patience(self, patience: Duration) -> Self {
        let opened = self.opened().changed(|device| device.waiting(patience));
        self.with_opened(opened)
    }

    /// Submissions so far, which [`Injection`] counts.
    #[doc(hidden)]
    pub fn submissions(&self) -> u64 {
        self.opened().device.submissions()
    }

    /// The same adapter, opened as `opened`, without any failure so far.
    fn with_opened(self, opened: Opened) -> Self {
        Self { state: Mutex::new(State::new(opened)), events: Mutex::default(), ..self }
    }

    /// The device and what is kept on it.
    fn opened(&self) -> Arc<Opened> {
        self.state().opened()
    }

    /// Times every dispatch on the device from now on, or no longer; off at first.
    ///
    /// Timed dispatches run in a pass each, and the host waits for each submission. On an adapter
    /// without timestamp queries nothing changes.
    pub fn time_kernels(&self, on: bool) {
        self.setup.clock.switch(on);
    }

    /// Times since the last call, by kernel, in the order in which they first ran; empty where
    /// nothing was timed.
    pub fn take_kernel_times(&self) -> Vec<KernelTime> {
        self.setup.clock.take()
    }

    /// Measures what the adapter can do; takes a second or so, more on a software adapter.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if a kernel fails or leaves wrong results.
    pub fn measure_limits(&self) -> Result<DeviceLimits> {
        limits::measure(&self.opened())
    }

    /// The adapter in figures.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// The adapter in words: name, interface, kind and driver.
    pub fn device(&self) -> String {
        self.adapter.to_string()
    }

    /// See [`super::Backend::reach_avoid`].
    pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &ReachAvoidTask<'_>,
        sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        recover::reach_avoid(self, plant, task, sink)
    }

    /// See [`super::Backend::deviation`].
    pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &DeviationTask<'_>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        recover::deviation(self, plant, task, sink)
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
        recover::mppi(self, system, cost, task)
    }
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Gpu").field(&self.adapter).finish()
    }
}
