//! Deterministic certificates: what they certify, and that nothing certified fails.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod adversary;
mod cases;
#[path = "../common/mod.rs"]
mod common;
mod refused;
mod shares;
