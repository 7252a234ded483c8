//! What a batch of rollouts is: starts, horizon, measure; no word about who runs it.

mod fold;
mod mppi;
mod noise;
mod philox;
mod reference;
mod region;
pub mod replay;
mod sample;
mod spec;
mod starts;

pub use crate::files::{StateList, States};
pub use fold::{Fold, HUGE, NON_FINITE, reach_avoid};
pub use mppi::{
    CostQuery, Disturbance, MAX_PLAN, MAX_SAMPLES, MppiProblem, MppiResult, MppiSettings, MppiSpec,
    MppiTask, NoiseKind, Sigma, ValueTerm,
};
pub use noise::{Noise, NoiseShape, SPLINE_SUPPORT, SplineRow};
pub use philox::philox;
pub use reference::{measure, pair_measures, trajectory};
pub use region::{Ball, Region, sample_ball};
pub use sample::{GENERATOR, Purpose, Stream, normal_pair};
pub use spec::{
    DeviationTask, Farthest, MAX_HORIZON, PairControl, PairMeasure, Plant, Query, ReachAvoidTask,
    RolloutSpec, Tightening,
};
pub use starts::{Pairs, Starts};
