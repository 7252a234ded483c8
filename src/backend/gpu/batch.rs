//! The dispatches of one submission and their parameters.

use super::kernel::Bound;
use super::params::Params;
use super::timing::Stamps;

/// Dispatches of one submission and their parameters.
#[derive(Default)]
pub(super) struct Batch<'a> {
    blocks: Vec<u8>,
    calls: Vec<(&'a Bound, u32, [u32; 2])>,
}

impl<'a> Batch<'a> {
    /// Adds a dispatch of `groups` workgroups.
    pub(super) fn push(&mut self, bound: &'a Bound, params: &Params, groups: [u32; 2]) {
        self.calls.push((bound, self.blocks.len() as u32, groups));
        self.blocks.extend_from_slice(bytemuck::bytes_of(params));
        self.blocks.resize(self.blocks.len().next_multiple_of(Params::PITCH), 0);
    }

    /// Records the dispatches: in one pass, or in one each where they are timed.
    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder, stamps: Option<&Stamps>) {
        let Some(stamps) = stamps else {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for (bound, offset, groups) in &self.calls {
                bound.dispatch(&mut pass, *offset, *groups);
            }
            return;
        };
        for (number, (bound, offset, groups)) in self.calls.iter().enumerate() {
            let mut pass = encoder.begin_compute_pass(&stamps.pass(number));
            bound.dispatch(&mut pass, *offset, *groups);
        }
        stamps.resolve(encoder);
    }

    /// The kernel of each dispatch.
    pub(super) fn kernels(&self) -> impl Iterator<Item = &'static str> {
        self.calls.iter().map(|(bound, ..)| bound.kernel())
    }

    /// Their parameters, a block each.
    pub(super) fn blocks(&self) -> &[u8] {
        &self.blocks
    }

    /// Number of dispatches.
    pub(super) fn len(&self) -> u64 {
        self.calls.len() as u64
    }

    /// Adds a dispatch over all columns.
    pub(super) fn push_columns(&mut self, bound: &'a Bound, params: &Params) {
        let groups = params.columns.div_ceil(bound.columns());
        self.push(bound, params, [groups, 1]);
    }
}
