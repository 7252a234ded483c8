//! An adapter that work is given to: opened, set up for tests, asked what it did.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::device::Device;
use super::fault::Injection;
use super::fusing::NetworkKernels;
use super::limits::{self, DeviceLimits};
use super::listing::{Adapter, Choice};
use super::mppi_source::PlanSource;
use super::opened::{Opened, Setup};
use super::recent::Recent;
use super::source::Sources;
use super::state::State;
use super::timing::KernelTime;
use super::traffic::Traffic;
use crate::backend::Event;
use crate::backend::cpu::Cpu;
use crate::error::Result;

/// Plannings that are remembered.
const PLANS: usize = 16;

/// An adapter, and what becomes of the work where it fails.
///
/// Out of memory, or over time, it goes on in chunks of half the size, down to a smallest one. A
/// device that is lost is opened again, once. After that, and where a driver refuses what it is
/// given, the rest is for the CPU if that was allowed, and an error if not.
pub struct Gpu {
    pub(super) adapter: Adapter,
    pub(super) setup: Setup,
    state: Mutex<State>,
    pub(super) fallback: Option<Cpu>,
    events: Mutex<Vec<Event>>,
    pub(super) sources: Sources,
    /// What was planned for last.
    pub(super) plans: Recent<Arc<PlanSource>>,
}

impl Gpu {
    /// Opens an adapter. Where its driver allows, compiled kernels are kept in the user's folder
    /// for caches, or in the folder that `REACHCAST_PIPELINE_CACHE` names; `off` keeps none.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if none fits the choice or it does not open; it names those found.
    pub fn open(choice: &Choice) -> Result<Self> {
        let device = Device::open(choice)?;
        let setup = Setup::default();
        Ok(Self {
            adapter: device.adapter.clone(),
            state: Mutex::new(State::new(Opened::new(device, setup.clone()))),
            setup,
            fallback: None,
            events: Mutex::default(),
            sources: Sources::default(),
            plans: Recent::new(PLANS),
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
    pub(crate) fn lend(&self) -> Result<super::lent::Lent> {
        super::lent::Lent::open(&self.adapter)
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
        let opened = self.opened().set_up(self.setup.clone());
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

    /// What calls cost the host so far.
    #[doc(hidden)]
    pub fn traffic(&self) -> Traffic {
        self.opened().device.counters.so_far()
    }

    /// Time that calls spent in the driver so far, submitting and waiting.
    #[doc(hidden)]
    pub fn driver_time(&self) -> Duration {
        self.opened().device.counters.driver_time()
    }

    /// Where calls run now.
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers what failed and was worked around.
    pub(super) fn note(&self, event: Event) {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).push(event);
    }

    /// The same adapter, opened as `opened`, without any failure so far.
    fn with_opened(self, opened: Opened) -> Self {
        Self { state: Mutex::new(State::new(opened)), events: Mutex::default(), ..self }
    }

    /// The device and what is kept on it.
    pub(super) fn opened(&self) -> Arc<Opened> {
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

    /// The adapter in words: name, interface, kind and driver; where the CPU has taken over, the CPU too, and alone
    /// if no result came from the adapter.
    pub fn device(&self) -> String {
        let state = self.state();
        match self.fallback.as_ref().filter(|_| state.on_cpu) {
            Some(cpu) if state.served => format!("{}; then {}", self.adapter, cpu.device()),
            Some(cpu) => cpu.device(),
            None => self.adapter.to_string(),
        }
    }

    /// `gpu`, or `cpu` where all results came from there.
    pub(in crate::backend) fn name(&self) -> &'static str {
        let state = self.state();
        if state.on_cpu && !state.served { "cpu" } else { "gpu" }
    }
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Gpu").field(&self.adapter).finish()
    }
}
