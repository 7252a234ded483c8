//! Parameters of a dispatch.

use std::num::NonZeroU64;

use bytemuck::{Pod, Zeroable};

use super::compose::{BLOCK_WORDS, COLUMNS_WORD, GROUPS_WORD};
use crate::rollout::{Region, RolloutSpec, Starts};

// The words that `shaders/narrow.wgsl` changes are where they are meant to be.
const _: () = assert!(std::mem::offset_of!(Params, columns) == 4 * COLUMNS_WORD);
const _: () = assert!(size_of::<Params>() <= 4 * GROUPS_WORD);

/// `region_kind` of a box.
const REGION_BOX: u32 = 0;
/// `region_kind` of a ball.
const REGION_BALL: u32 = 1;
/// `region_kind` of starts that the host lists.
const REGION_LISTED: u32 = 2;

/// Parameters of one dispatch; twin: `shaders/params.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(missing_docs, reason = "the names are those of the shader and say what they hold")]
pub struct Params {
    pub key_low: u32,
    pub key_high: u32,
    pub stream: u32,
    pub zero: u32,
    pub pair_key_low: u32,
    pub pair_key_high: u32,
    pub pair_stream: u32,
    pub pair_radius: f32,
    pub first_low: u32,
    pub first_high: u32,
    pub columns: u32,
    pub stride: u32,
    pub step: u32,
    pub steps: u32,
    pub horizon: u32,
    pub region_kind: u32,
    pub paired: u32,
    pub closed_loop: u32,
    pub sign_only: u32,
    pub layer_offset: u32,
    pub layer_inputs: u32,
    pub layer_outputs: u32,
    pub layer_neurons: u32,
    pub segment_start: u32,
    pub iteration: u32,
    pub samples: u32,
    pub width: u32,
    pub rounds: u32,
    pub temperature: f32,
}

impl Params {
    /// Bytes of the block.
    pub(super) const SIZE: NonZeroU64 = match NonZeroU64::new(size_of::<Self>() as u64) {
        Some(size) => size,
        None => panic!("the block of parameters is not empty"),
    };

    /// Bytes from one block to the next: the largest alignment that an adapter may ask for.
    pub(super) const PITCH: usize = 4 * BLOCK_WORDS;

    /// The parameters for `columns` trajectories from index `first` on.
    pub(super) fn at(mut self, first: u64, columns: u32) -> Self {
        self.first_low = first as u32;
        self.first_high = (first >> 32) as u32;
        self.columns = columns;
        self
    }

    /// The parameters for the steps `step..step + steps`.
    pub(super) fn over(mut self, step: u32, steps: u32) -> Self {
        self.step = step;
        self.steps = steps;
        self
    }

    /// The parameters of starts; the rest is 0.
    pub(super) fn of_starts(starts: &Starts<'_>, spec: &RolloutSpec) -> Self {
        let mut params =
            Self { horizon: spec.horizon, region_kind: REGION_LISTED, ..Self::default() };
        if let Starts::Drawn { region, stream } = starts {
            [params.key_low, params.key_high] = stream.key();
            params.stream = stream.id();
            params.region_kind = match region {
                Region::Box { .. } => REGION_BOX,
                Region::Ball(_) | Region::Ellipsoid(_) => REGION_BALL,
            };
        }
        params
    }
}
