//! Certificates.

pub mod bound;
pub mod ledger;
mod tail;
