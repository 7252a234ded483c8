//! The kernels, what they bind, and sizes that they share with Rust.

/// Threads of a workgroup, one trajectory, pair or tile of a layer each.
pub const WORKGROUP: u32 = 64;
/// Trajectories that one thread of a layer computes.
pub const TILE_COLUMNS: u32 = 8;
/// Threads of a workgroup that compute the same neurons, each for other trajectories.
pub const TILE_PITCH: u32 = WORKGROUP / TILE_COLUMNS;
/// Vectors of 4 neurons that one thread of a layer computes.
pub const TILE_QUADS: u32 = 2;
/// Trajectories or pairs that one workgroup counts.
pub const COUNTED: u32 = 64 * WORKGROUP;
/// Numbers of a partial of MPPI before its sums of controls.
pub const PARTIAL_HEADER: u32 = 6;

/// The kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Draws starts or pairs.
    Sample,
    /// Rolls trajectories and folds their margins.
    ReachAvoid,
    /// Keeps the trajectories whose sign is open.
    Compact,
    /// Sets dispatches to the trajectories that are left.
    Narrow,
    /// Rolls pairs side by side.
    Deviation,
    /// Finds the farthest pair of each step.
    Reduce,
    /// Counts measures or signs.
    Count,
    /// Counts how pairs fared.
    CountPairs,
    /// Evaluates what a network sees.
    Observe,
    /// Evaluates the part of that number of formulas that call networks.
    Link(u32),
    /// A layer of the network, with the activation of that number of its kinds.
    Layer(u32),
    /// A layer of the network without what comes behind its sums.
    Sums,
    /// The norm of a layer and its activation, of that number of the kinds of the network.
    Norm(u32),
    /// Puts the samples of MPPI problems at their starts.
    MppiStart,
    /// Rolls the samples of MPPI problems and adds up their costs.
    MppiRollout,
    /// Adds what the end of MPPI problems costs.
    MppiTerminal,
    /// Weighs the samples of MPPI problems.
    MppiUpdate,
    /// Multiplies and adds in registers.
    Peak,
    /// Copies a buffer.
    Copy,
}

/// How a kernel uses a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The uniform block of parameters, at a dynamic offset.
    Uniform,
    /// Uniform numbers that all dispatches of a call share.
    Constant,
    /// Blocks of parameters that are written, at a dynamic offset.
    Blocks,
    /// Storage that is read.
    Read,
    /// Storage that is read and written.
    ReadWrite,
}

/// Buffers by the number that they are bound to; the shaders declare them under the same names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Slot {
    /// `params`.
    Params = 0,
    /// `region`: one vector per coordinate, or the starts that the host lists.
    Region = 1,
    /// `schedule`: one vector per step.
    Schedule = 2,
    /// `state`: vectors of 4 states, `[NX / 4, sides, stride]`.
    State = 3,
    /// `folds`: `[sides, stride]`.
    Folds = 4,
    /// `origin`: place of each column in the chunk.
    Origin = 5,
    /// `control`: vectors of 4 outputs of the network.
    Control = 6,
    /// `measures` or `pair_measures`, by place in the chunk.
    Measures = 7,
    /// `distances`: `[steps, stride]`.
    Distances = 8,
    /// `farthest`: `[T + 1]`.
    Farthest = 9,
    /// `kept_state`.
    KeptState = 10,
    /// `kept_folds`.
    KeptFolds = 11,
    /// `kept_origin`.
    KeptOrigin = 12,
    /// `survivors`: one number.
    Survivors = 13,
    /// `weights`: the network's parameters.
    Weights = 14,
    /// `source`: the input of a layer.
    Source = 15,
    /// `sink`: its output.
    Sink = 16,
    /// `streams`: key and stream of each problem's noise.
    Streams = 17,
    /// `plans`: nominal controls, and what the cost wants to know, `[problems, H, NU + NC]`; where the
    /// end costs, `[problems, NU + NC]` behind them, without controls.
    Plans = 18,
    /// `starts`: `[problems, NX]`.
    Starts = 20,
    /// `totals`: cost of each sample so far.
    Totals = 21,
    /// `spline`: knots of each step.
    Spline = 22,
    /// `carry`: correlated noise of the step before, `[NU, stride]`.
    Carry = 23,
    /// `value`: vectors of 4, the first number is the output of the value network.
    Value = 24,
    /// `push`: vectors of 4 outputs of the disturbance network.
    Push = 25,
    /// `partials`: softmin of each workgroup.
    Partials = 26,
    /// `values`: the parameters of the model, in vectors of 4.
    Values = 27,
    /// `cells`: the costs of the cells of a map.
    Cells = 28,
    /// `kept`: numbers that parts of formulas keep for later ones, `[numbers, stride]`.
    Kept = 30,
    /// `asked`: vectors of 4 inputs of networks that formulas call.
    Asked = 31,
    /// `said`: vectors of 4 outputs of such networks.
    Said = 32,
    /// `blocks`: parameters of the dispatches that follow.
    Blocks = 33,
    /// `left`: one number, the survivors of the other set of columns.
    Left = 34,
    /// `counts`: of each workgroup that counts.
    Counts = 35,
}

impl Kernel {
    /// The kernels of measures, pairs and networks, those of layers for a network with two activations.
    pub const ROLLOUT: [Self; 11] = [
        Self::Sample,
        Self::ReachAvoid,
        Self::Compact,
        Self::Narrow,
        Self::Deviation,
        Self::Reduce,
        Self::Count,
        Self::CountPairs,
        Self::Layer(0),
        Self::Layer(1),
        Self::Observe,
    ];

    /// The kernels of MPPI where the end of a plan costs nothing.
    pub const MPPI: [Self; 3] = [Self::MppiStart, Self::MppiRollout, Self::MppiUpdate];

    /// The kernels that measure what an adapter can do.
    pub const LIMITS: [Self; 2] = [Self::Peak, Self::Copy];

    /// Name of the entry point.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::ReachAvoid => "reach_avoid",
            Self::Compact => "compact",
            Self::Narrow => "narrow",
            Self::Deviation => "deviation",
            Self::Reduce => "reduce",
            Self::Count => "count",
            Self::CountPairs => "count_pairs",
            Self::Observe => "observe",
            Self::Link(_) => "link",
            Self::Layer(_) | Self::Sums => "mlp",
            Self::Norm(_) => "norm",
            Self::MppiStart => "mppi_start",
            Self::MppiRollout => "mppi_rollout",
            Self::MppiTerminal => "mppi_terminal",
            Self::MppiUpdate => "mppi_update",
            Self::Peak => "peak",
            Self::Copy => "copy",
        }
    }

    /// Threads of a workgroup.
    pub fn workgroup(self) -> u32 {
        if self == Self::Narrow { 1 } else { WORKGROUP }
    }

    /// What the kernel binds, for a plant driven by a network or by a formula; for MPPI, where the
    /// noise is independent, and neither context, map nor network takes part.
    pub fn bindings(self, network: bool) -> Vec<(Slot, Access)> {
        use Access::{Read, ReadWrite, Uniform};
        use Slot as S;
        if self == Self::Narrow {
            return vec![(S::Blocks, Access::Blocks), (S::Left, Read), (S::Survivors, ReadWrite)];
        }
        let mut list = vec![(S::Params, Uniform)];
        let more: &[(Slot, Access)] = match self {
            Self::Sample => &[
                (S::Region, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Origin, ReadWrite),
            ],
            Self::ReachAvoid => &[
                (S::Schedule, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Origin, Read),
                (S::Measures, ReadWrite),
            ],
            Self::Compact => &[
                (S::State, Read),
                (S::Folds, Read),
                (S::Origin, Read),
                (S::KeptState, ReadWrite),
                (S::KeptFolds, ReadWrite),
                (S::KeptOrigin, ReadWrite),
                (S::Survivors, ReadWrite),
            ],
            Self::Deviation => &[
                (S::Schedule, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Measures, ReadWrite),
                (S::Distances, ReadWrite),
            ],
            Self::Narrow => &[],
            Self::Reduce => &[(S::Distances, Read), (S::Farthest, ReadWrite)],
            Self::Count | Self::CountPairs => &[(S::Measures, Read), (S::Counts, ReadWrite)],
            Self::Observe => &[(S::State, Read), (S::Sink, ReadWrite)],
            Self::Link(_) => &[(S::State, Read), (S::Kept, ReadWrite)],
            Self::Layer(_) | Self::Sums => {
                &[(S::Weights, Read), (S::Source, Read), (S::Sink, ReadWrite)]
            }
            Self::Norm(_) => &[(S::Weights, Read), (S::Sink, ReadWrite)],
            Self::MppiStart => &[(S::Starts, Read), (S::State, ReadWrite), (S::Totals, ReadWrite)],
            Self::MppiRollout => &[
                (S::Streams, Read),
                (S::Plans, Read),
                (S::State, ReadWrite),
                (S::Totals, ReadWrite),
            ],
            Self::MppiTerminal => &[(S::State, Read), (S::Streams, Read), (S::Totals, ReadWrite)],
            Self::MppiUpdate => {
                &[(S::Streams, Read), (S::Plans, Read), (S::Totals, Read), (S::Partials, ReadWrite)]
            }
            Self::Peak => &[(S::Sink, ReadWrite)],
            Self::Copy => &[(S::Source, Read), (S::Sink, ReadWrite)],
        };
        list.extend_from_slice(more);
        if network && matches!(self, Self::ReachAvoid | Self::Deviation) {
            list.push((S::Control, Read));
        }
        list
    }
}
