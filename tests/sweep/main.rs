//! Sweeps: their points, and their input.

#[path = "../common/mod.rs"]
mod common;
#[path = "../sweep_run/mod.rs"]
mod sweep_run;

mod input;
mod points;
