//! Points inside a period against brute force over fine trajectories: on every backend and in f64.

mod backends;
#[path = "../common/mod.rs"]
mod common;
mod in_f64;
mod mathematics;
mod said;
