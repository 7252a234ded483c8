//! What a batch of rollouts is: starts, horizon, measure; no word about who runs it.

pub mod drops;
mod ellipsoid;
mod fold;
mod held;
mod measure_tally;
mod mppi;
mod mppi_settings;
mod noise;
mod pair_tally;
mod philox;
mod planning;
mod region;
pub mod replay;
mod sample;
pub(crate) mod side_by_side;
mod spec;
mod starts;
mod tally;
mod tally_origin;

pub use crate::files::{StateList, States};
pub use ellipsoid::Ellipsoid;
pub use fold::{Fold, HUGE, NON_FINITE, measure_as, reach_avoid};
pub use held::Keep;
pub use measure_tally::{Extreme, MeasureCounts, MeasureTally, Measures};
pub use mppi::MppiSpec;
pub use mppi_settings::{MAX_PLAN, MAX_SAMPLES, MppiSettings, NoiseKind, Sigma};
pub use noise::{Noise, NoiseShape, SPLINE_SUPPORT, SplineRow};
pub use pair_tally::{PairCounts, PairResults, PairTally};
pub use philox::philox;
pub use planning::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiTask, Planning, ValueTerm,
};
pub use region::{Ball, Region, sample_ball};
pub use sample::{GENERATOR, Purpose, Stream, normal_pair};
pub use spec::{
    DeviationTask, Effect, Farthest, MAX_HORIZON, PairControl, PairMeasure, Query, ReachAvoidTask,
    RolloutSpec, Tightening,
};
pub use starts::{Pairs, Starts};
pub(crate) use tally::Partial;
pub use tally::PlanTally;
pub(crate) use tally_origin::Origin;
