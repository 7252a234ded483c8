//! Backends: who runs a batch of rollouts.

pub mod cpu;
mod event;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "absent.rs"]
pub mod gpu;
mod measures;
mod open;
mod physics;
mod plan_program;
mod program;
mod sink;
mod tallied;
mod task;

use cpu::Cpu;
use gpu::Gpu;

pub use event::{Action, Event, add_events};
pub use physics::physics;
pub use plan_program::PlanProgram;
pub use program::Program;
pub use sink::{MeasureSink, PairSink};

/// The native CPU, or a GPU through wgpu; in a build without the feature `gpu`, the CPU alone.
#[derive(Debug)]
#[cfg_attr(
    feature = "gpu",
    expect(clippy::large_enum_variant, reason = "a program has one, and passes it by reference")
)]
pub enum Backend {
    /// Lanes and threads on the host.
    Cpu(Cpu),
    /// WGSL on an adapter.
    Gpu(Gpu),
}

impl Backend {
    /// `cpu` or `gpu`, whoever gave results; `gpu` where both did.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Cpu(_) => "cpu",
            Self::Gpu(gpu) => gpu.name(),
        }
    }

    /// The device in words, as reports name it.
    pub fn device(&self) -> String {
        match self {
            Self::Cpu(cpu) => cpu.device(),
            Self::Gpu(gpu) => gpu.device(),
        }
    }

    /// What failed on an adapter so far and was worked around, in order.
    pub fn events(&self) -> Vec<Event> {
        match self {
            Self::Cpu(cpu) => cpu.events(),
            Self::Gpu(gpu) => gpu.events(),
        }
    }
}
