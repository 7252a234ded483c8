//! The controllers of the race: by name, with what they share.

mod baseline;
mod hybrid;
mod interface;
mod no_policy;
pub(in crate::race) mod plan;
pub(in crate::race) mod roster;

pub use interface::{Active, Controller, Decision, FilterLog, Name, World};
