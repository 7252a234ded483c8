//! Controllers' parts: sampled plans, the barrier filter, and the tier of a state.

mod cbf;
pub mod mppi;
pub mod tier;

pub use cbf::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
