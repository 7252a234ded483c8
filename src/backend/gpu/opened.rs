//! An opened adapter: its device, and what is kept on it between calls.

use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::Pool;
use super::device::Device;
use super::flight::Flight;
use super::kernel::{Edit, Pipelines};
use super::plan::NetworkKernels;
use super::program::Program;
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
    /// The one that was used last stands last.
    programs: Mutex<Vec<Arc<Program>>>,
}

impl Opened {
    /// Nothing compiled yet, no buffer made.
    pub(super) fn new(device: Device, setup: Setup) -> Self {
        let pipelines = match &setup.edit {
            Some(edit) => Pipelines::edited(Arc::clone(edit)),
            None => Pipelines::new(&device),
        };
        let (pipelines, pool) = (Arc::new(pipelines), Pool::default());
        Self { device, pipelines, pool, setup, programs: Mutex::default() }
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
            programs: Mutex::default(),
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
        let mut programs = self.programs.lock().unwrap_or_else(PoisonError::into_inner);
        let program = match programs.iter().position(|program| program.is(source)) {
            Some(at) => programs.remove(at),
            None => {
                let on = (&flight.device, &self.pool);
                Arc::new(Program::new(on, &self.pipelines, source, self.setup.networks)?)
            }
        };
        programs.push(Arc::clone(&program));
        if programs.len() > KEPT {
            programs.remove(0);
        }
        Ok(program)
    }

    /// Lets go of all buffers that no call uses.
    pub(super) fn clear(&self) {
        self.programs.lock().unwrap_or_else(PoisonError::into_inner).clear();
        self.pool.clear();
    }
}
