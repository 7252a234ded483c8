//! A plant prepared on a device: its kernels, and the buffers of its calls.

use std::sync::Arc;

use super::attempt::Attempt;
use super::buffer::Pool;
use super::chain_load::ChainLoad;
use super::chunking::{Chunking, Size, Work};
use super::compiled::Compiled;
use super::device::Device;
use super::flight::Flight;
use super::fusing::NetworkKernels;
use super::kernel::Pipelines;
use super::recent::Recent;
use super::source::Source;
use super::traffic::Count;
use super::workspace::{Shape, Workspace};
use crate::error::Result;

/// Workspaces that are kept: one for each thread and shape that calls take turns with.
pub(super) const KEPT: usize = 4;
/// Largest workspace that is kept, bytes: beyond it, binding its buffers anew is nothing beside the
/// work, and the pool keeps them.
pub(super) const KEPT_BYTES: u64 = 8 << 20;

/// A plant prepared on a device.
pub(super) struct Program {
    source: Arc<Source>,
    compiled: Compiled,
    kept: Recent<Workspace>,
}

impl Program {
    /// The plant of `source` on `device`, its network's parameters uploaded.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if a network is to be fused and does not fit.
    pub(super) fn new(
        device: &Device,
        pool: &Pool,
        pipelines: &Arc<Pipelines>,
        source: &Arc<Source>,
        networks: NetworkKernels,
    ) -> Result<Self> {
        device.counters.add(Count::Program);
        let compiled = Compiled::new(device, pool, pipelines, source, networks)?;
        Ok(Self { source: Arc::clone(source), compiled, kept: Recent::new(KEPT) })
    }

    /// Whether it is the plant of `source`.
    pub(super) fn is(&self, source: &Arc<Source>) -> bool {
        Arc::ptr_eq(&self.source, source)
    }

    /// How `count` starts or pairs are cut up.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if not even the smallest chunk fits.
    pub(super) fn chunking(
        &self,
        device: &Device,
        attempt: &Attempt,
        work: Work,
        count: u64,
    ) -> Result<Chunking> {
        let network = self.source.network.as_deref();
        let text = &self.compiled.text;
        let chain = text.chain().map(ChainLoad::new);
        let size = Size {
            states: text.states(),
            flops: text.operations(),
            points: text.points(),
            network,
            fused: text.fused(),
            chain: chain.as_ref(),
            seen: network.filter(|_| text.observes()).map_or(0, |mlp| mlp.widths()[0]),
            count,
        };
        let chunking = Chunking::new(&device.adapter, attempt.limit, work, &size)?;
        attempt.columns.set(u64::from(chunking.stride));
        Ok(chunking)
    }

    /// A workspace of `shape`: a kept one, or a new one.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn take(&self, flight: &Flight<'_>, shape: Shape) -> Result<Workspace> {
        let kept = self.kept.take(|workspace| workspace.shape == shape);
        let network = self.source.network.as_deref();
        kept.map_or_else(|| Workspace::new(flight, &self.compiled, network, shape), Ok)
    }

    /// Keeps `workspace` for a later call.
    pub(super) fn keep(&self, workspace: Workspace) {
        if workspace.size() <= KEPT_BYTES {
            self.kept.keep(workspace);
        }
    }
}
