//! Controllers' parts that look at one state and one control at a time.

mod cbf;

pub use cbf::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
