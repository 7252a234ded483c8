//! Counterexamples: starts and pairs that fail, the worst first, to be stored and replayed.

mod csv;
mod pairs;
mod worst;

pub use csv::{COUNTEREXAMPLES, REPLAYED, is_replayed, read_replayed, replayed_csv, starts_csv};
pub use pairs::{FailingPair, Replayed};
pub(super) use pairs::{failing_pair, failing_pairs};
pub use worst::FailingStart;
pub(super) use worst::Worst;
