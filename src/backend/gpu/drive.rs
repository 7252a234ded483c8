//! What drives rollouts on the device: a formula, a network's layers, or the network in the rollout.

use super::buffer::Buffer;
use super::kernel::Bound;
use super::network::{Network, upload};
use super::run::{Batch, Job};
use crate::error::Result;
use crate::policy::Mlp;

/// What drives the rollouts of a call.
pub(super) enum Drive {
    /// The rollout kernels have the formula.
    Formula,
    /// Dispatches between the steps.
    Layers(Network),
    /// The rollout kernels run the network, whose parameters these are.
    Fused(Buffer),
}

impl Drive {
    /// Uploads the network of `job`, if it has one.
    pub(super) fn new(job: &Job<'_>, network: Option<&Mlp>) -> Self {
        match network {
            None => Self::Formula,
            Some(mlp) if job.fused() => Self::Fused(upload(&job.call, mlp)),
            Some(mlp) => Self::Layers(Network::new(&job.call, mlp, job.plan.row)),
        }
    }

    /// What the rollout kernels read: controls, or parameters.
    pub(super) fn source(&self) -> Option<&Buffer> {
        match self {
            Self::Formula => None,
            Self::Layers(network) => Some(network.output()),
            Self::Fused(weights) => Some(weights),
        }
    }

    /// The layers bound to `state`, where they have dispatches of their own.
    pub(super) fn bind(&self, job: &Job<'_>, state: &Buffer) -> Result<Vec<Bound>> {
        match self {
            Self::Layers(network) => network.bind(&job.call, state),
            Self::Formula | Self::Fused(_) => Ok(Vec::new()),
        }
    }

    /// Adds the dispatches of the layers, if any, over the first `columns` columns.
    pub(super) fn forward<'a>(
        &self,
        batch: &mut Batch<'a>,
        layers: &'a [Bound],
        columns: u32,
        row: u32,
    ) {
        if let Self::Layers(network) = self {
            network.forward(batch, layers, columns, row);
        }
    }
}
