//! Experiments: whole races of many controllers, judged and compared.

mod baseline;
pub mod controller;
mod hybrid;
pub mod judge;
pub mod metrics;
mod no_policy;
mod plan;
pub mod race;
pub mod record;
pub mod settings;
pub mod statistics;
