//! What a batch of rollouts is: starts, horizon, measure; no word about who runs it.

mod fold;
mod philox;
mod reference;
mod sample;
mod spec;

pub use fold::{Fold, HUGE, NON_FINITE, reach_avoid};
pub use philox::philox;
pub use reference::{measure, pair_measures, trajectory};
pub use sample::{
    Ball, GENERATOR, Pairs, Purpose, Region, Starts, Stream, normal_pair, sample_ball,
};
pub use spec::{
    DeviationTask, Farthest, MAX_HORIZON, PairControl, PairMeasure, Plant, Query, ReachAvoidTask,
    RolloutSpec, Tightening,
};
