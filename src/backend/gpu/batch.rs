//! The dispatches of one submission and their parameters.

use super::compose::GROUPS_WORD;
use super::kernel::Bound;
use super::params::Params;
use super::timing::Stamps;

/// Dispatches of one submission and their parameters.
#[derive(Default)]
pub(super) struct Batch<'a> {
    blocks: Vec<u8>,
    calls: Vec<Dispatch<'a>>,
    /// Where the device counts workgroups, if it does.
    counted: Option<Counted>,
    /// The dispatch that narrows those that are added.
    narrowing: Option<usize>,
}

/// A kernel, where its parameters begin, and its workgroups.
struct Dispatch<'a> {
    bound: &'a Bound,
    offset: u32,
    groups: Groups,
}

/// How many workgroups run.
#[derive(Clone, Copy)]
enum Groups {
    /// In x and in y.
    Known([u32; 2]),
    /// As many as the block of parameters says by then.
    Counted,
}

/// The parameters of dispatches on the device.
pub(super) struct Counted {
    /// The buffer that they are in.
    pub(super) buffer: wgpu::Buffer,
    /// Where the first begins.
    pub(super) start: u64,
}

impl<'a> Batch<'a> {
    /// Adds a dispatch of `groups` workgroups; of fewer in x where dispatches are narrowed.
    pub(super) fn push(&mut self, bound: &'a Bound, params: &Params, groups: [u32; 2]) {
        let offset = self.blocks.len();
        self.blocks.extend_from_slice(bytemuck::bytes_of(params));
        self.blocks.resize(offset + 4 * GROUPS_WORD, 0);
        let behind = [groups[0], groups[1], 1, bound.columns()];
        self.blocks.extend_from_slice(bytemuck::bytes_of(&behind));
        self.blocks.resize(offset + Params::PITCH, 0);
        let groups = match self.narrowing {
            None => Groups::Known(groups),
            Some(at) => {
                self.calls[at].add_group();
                Groups::Counted
            }
        };
        self.calls.push(Dispatch { bound, offset: offset as u32, groups });
    }

    /// Adds `narrow`, which sets the dispatches that are added from here on to the trajectories that are
    /// left by then; their parameters are in `counted`.
    pub(super) fn narrow(&mut self, narrow: &'a Bound, counted: Counted) {
        (self.counted, self.narrowing) = (Some(counted), Some(self.calls.len()));
        let (offset, groups) = (self.blocks.len() as u32, Groups::Known([0, 1]));
        self.calls.push(Dispatch { bound: narrow, offset, groups });
    }

    /// Whether the device changes the parameters of some dispatches.
    pub(super) fn is_narrowed(&self) -> bool {
        self.counted.is_some()
    }

    /// What is added from here on is not narrowed.
    pub(super) fn widen(&mut self) {
        self.narrowing = None;
    }

    /// Records the dispatches: in one pass, or in one each where they are timed. The number of passes.
    pub(super) fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        stamps: Option<&Stamps>,
    ) -> u64 {
        let Some(stamps) = stamps else {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.calls.iter().for_each(|call| self.run(&mut pass, call));
            return 1;
        };
        for (number, call) in self.calls.iter().enumerate() {
            let mut pass = encoder.begin_compute_pass(&stamps.pass(number));
            self.run(&mut pass, call);
        }
        stamps.resolve(encoder);
        self.len()
    }

    /// Records a dispatch.
    fn run(&self, pass: &mut wgpu::ComputePass<'_>, call: &Dispatch<'a>) {
        call.bound.choose(pass, call.offset);
        match (call.groups, &self.counted) {
            (Groups::Counted, Some(counted)) => {
                let words = u64::from(call.offset) + 4 * GROUPS_WORD as u64;
                pass.dispatch_workgroups_indirect(&counted.buffer, counted.start + words);
            }
            (Groups::Known([x, y]), _) => pass.dispatch_workgroups(x, y, 1),
            (Groups::Counted, None) => unreachable!("what is narrowed has its parameters"),
        }
    }

    /// The kernel of each dispatch.
    pub(super) fn kernels(&self) -> impl Iterator<Item = &'static str> {
        self.calls.iter().map(|call| call.bound.kernel())
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

impl Dispatch<'_> {
    /// One workgroup more.
    fn add_group(&mut self) {
        if let Groups::Known([x, _]) = &mut self.groups {
            *x += 1;
        }
    }
}
