//! The GPU backend: recorded physics spliced into the WGSL kernels, run through wgpu.

use super::{MeasureSink, PairSink};
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{DeviationTask, Farthest, Plant, ReachAvoidTask};
use crate::system::System;

/// An adapter with its queue and pipelines.
#[derive(Debug)]
pub struct Gpu {
    name: String,
}

/// What an adapter is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum AdapterKind {
    /// A program.
    Software,
}

/// An adapter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Adapter {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: AdapterKind,
}

impl std::fmt::Display for Adapter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name)
    }
}

/// Which adapter to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The best one that is not software.
    Hardware,
    /// The best one.
    Any,
    /// By name.
    Named(String),
}

/// The adapters of this machine.
pub fn adapters() -> Vec<Adapter> {
    Vec::new()
}

impl Gpu {
    /// Opens an adapter.
    pub fn open(choice: &Choice) -> Result<Self> {
        Err(crate::Error::Device(format!("no adapter for {choice:?}")))
    }

    /// The adapter in words.
    pub fn device(&self) -> String {
        self.name.clone()
    }

    /// See [`super::Backend::reach_avoid`].
    pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        _plant: Plant<'_, S, P>,
        _task: &ReachAvoidTask<'_, NX>,
        _sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        Ok(())
    }

    /// See [`super::Backend::deviation`].
    pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        _plant: Plant<'_, S, P>,
        _task: &DeviationTask<'_, NX>,
        _sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        Ok(Vec::new())
    }
}
