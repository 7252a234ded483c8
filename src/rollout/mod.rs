//! What a batch of rollouts is: starts, horizon, measure; no word about who runs it.

mod fold;
mod mppi;
mod noise;
mod philox;
mod reference;
pub mod replay;
mod sample;
mod spec;

pub use crate::files::{StateList, States};
pub use fold::{Fold, HUGE, NON_FINITE, reach_avoid};
pub use mppi::{
    CostQuery, Disturbance, MAX_PLAN, MAX_SAMPLES, MppiProblem, MppiResult, MppiSettings, MppiSpec,
    MppiTask, NoiseKind, Sigma, ValueTerm,
};
pub use noise::{Noise, NoiseShape, SPLINE_SUPPORT, SplineRow};
pub use philox::philox;
pub use reference::{measure, pair_measures, trajectory};
pub use sample::{
    Ball, GENERATOR, Pairs, Purpose, Region, Starts, Stream, normal_pair, sample_ball,
};
pub use spec::{
    DeviationTask, Farthest, MAX_HORIZON, PairControl, PairMeasure, Plant, Query, ReachAvoidTask,
    RolloutSpec, Tightening,
};
