//! Rollouts, drops, tallies and plans of the engine against what they are by definition.

mod changed;
#[path = "../common/mod.rs"]
mod common;
#[path = "../oracle/costs.rs"]
mod costs;
mod determinism;
mod diff_drive;
#[path = "../oracle/drive.rs"]
mod drive;
mod drops;
mod forms;
#[path = "../models/mod.rs"]
mod models;
mod mppi;
mod numeric;
#[path = "../oracle/mppi.rs"]
#[allow(dead_code, reason = "each test file uses a part of it")]
mod oracle;
mod oracles;
mod paid;
mod plans;
mod tallies;
