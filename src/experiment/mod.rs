//! Experiments: whole races of many controllers, judged and compared.

pub mod judge;
pub mod metrics;
pub mod record;
pub mod statistics;
