//! Points inside a period against brute force over fine trajectories: on every backend, in f64, and through the
//! commands.

#[path = "../mutants/mod.rs"]
#[macro_use]
mod mutants;

mod backends;
mod cli;
#[path = "../command/mod.rs"]
mod command;
#[path = "../common/mod.rs"]
mod common;
mod in_f64;
mod mathematics;
#[path = "../models/mod.rs"]
mod models;
mod networks;
mod said;
