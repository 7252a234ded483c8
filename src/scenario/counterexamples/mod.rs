//! Counterexamples: starts and pairs that fail, the worst first, to be stored and replayed.

mod csv;
mod pairs;
mod worst;

pub use csv::{COUNTEREXAMPLES, REPLAYED, is_replayed, read_replayed, replayed_csv, starts_csv};
pub(super) use pairs::failing_pairs;
pub use pairs::{FailingPair, Replayed};
pub use worst::FailingStart;
pub(super) use worst::Worst;
