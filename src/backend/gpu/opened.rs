//! An opened adapter: its device, and what is kept on it between calls.

use std::sync::Arc;

use super::buffer::Pool;
use super::device::Device;
use super::flight::Flight;
use super::fusing::NetworkKernels;
use super::kernel::{Edit, Pipelines};
use super::lists::Lists;
use super::mppi_program::PlanProgram;
use super::mppi_source::PlanSource;
use super::program::Program;
use super::recent::Recent;
use super::source::Source;
use super::timing::Clock;
use crate::error::Result;

/// Programs that are kept.
const KEPT: usize = 16;

/// How the kernels of an adapter are built and timed, however often it is opened.
#[derive(Clone, Default)]
pub(super) struct Setup {
    pub(super) edit: Option<Edit>,
    pub(super) networks: NetworkKernels,
    pub(super) clock: Arc<Clock>,
}

/// A device with its pipelines, programs and buffers.
pub(super) struct Opened {
    pub(super) device: Device,
    pub(super) pipelines: Arc<Pipelines>,
    pub(super) pool: Pool,
    pub(super) setup: Setup,
    /// Of this device, whoever lists them.
    pub(super) lists: Arc<Lists>,
    programs: Recent<Arc<Program>>,
    plan_programs: Recent<Arc<PlanProgram>>,
}

impl Opened {
    /// Nothing compiled yet, no buffer made.
    pub(super) fn new(device: Device, setup: Setup) -> Self {
        let pipelines = match &setup.edit {
            Some(edit) => Pipelines::edited(Arc::clone(edit)),
            None => Pipelines::new(&device),
        };
        Self {
            device,
            pipelines: Arc::new(pipelines),
            pool: Pool::default(),
            setup,
            lists: Arc::default(),
            programs: Recent::new(KEPT),
            plan_programs: Recent::new(KEPT),
        }
    }

    /// The same device, changed by `change`, which leaves kernels and buffers as they are.
    pub(super) fn changed(&self, change: impl FnOnce(Device) -> Device) -> Self {
        Self { device: change(self.device.clone()), ..self.set_up(self.setup.clone()) }
    }

    /// The same device, whose programs are made as `setup` says; its edit is that of the kernels.
    pub(super) fn set_up(&self, setup: Setup) -> Self {
        Self {
            device: self.device.clone(),
            pipelines: Arc::clone(&self.pipelines),
            pool: self.pool.clone(),
            setup,
            lists: Arc::clone(&self.lists),
            programs: Recent::new(KEPT),
            plan_programs: Recent::new(KEPT),
        }
    }

    /// The same adapter with a new device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if it is gone or does not open.
    pub(super) fn again(&self) -> Result<Self> {
        Ok(Self::new(self.device.reopened()?, self.setup.clone()))
    }

    /// The submissions of a call that begins now.
    pub(super) fn flight(&self) -> Flight<'_> {
        Flight::new(&self.device, &self.pool, &self.setup.clock)
    }

    /// The plant of `source` on this device, prepared before or now, for the call of `flight`.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if a network is to be fused and does not fit.
    pub(super) fn program(
        &self,
        flight: &Flight<'_>,
        source: &Arc<Source>,
    ) -> Result<Arc<Program>> {
        self.programs.get(
            |program| program.is(source),
            || {
                let (device, networks) = (&flight.device, self.setup.networks);
                Program::new(device, &self.pool, &self.pipelines, source, networks).map(Arc::new)
            },
        )
    }

    /// What is planned for by `source` on this device, prepared before or now, for the call of
    /// `flight`.
    pub(super) fn plan_program(
        &self,
        flight: &Flight<'_>,
        source: &Arc<PlanSource>,
    ) -> Result<Arc<PlanProgram>> {
        self.plan_programs.get(
            |program| program.is(source),
            || {
                let device = &flight.device;
                Ok(Arc::new(PlanProgram::new(device, &self.pool, &self.pipelines, source)))
            },
        )
    }

    /// Lets go of all buffers that no call uses.
    pub(super) fn clear(&self) {
        self.programs.clear();
        self.plan_programs.clear();
        self.lists.clear();
        self.pool.clear();
    }
}
