//! Experiments: whole races of many controllers, judged and compared.

mod baseline;
pub mod controller;
mod folder;
mod hybrid;
pub mod judge;
pub mod log;
pub mod metrics;
mod no_policy;
mod picture;
mod plan;
pub mod race;
pub mod record;
mod roster;
pub mod run;
pub mod settings;
pub mod statistics;
pub mod summary;
pub mod sweep;
#[cfg(test)]
mod tests;
mod weights;
