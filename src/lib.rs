//! Reachcast: batch rollouts on any GPU or CPU, and the probabilistic reach-avoid certificates
//! that they support.
//!
//! The layers, each importing only from those above it: [`real`], [`error`] and [`digest`]; [`system`] and
//! [`policy`]; [`rollout`]; [`backend`]; [`scenario`] and [`control`]; [`mod@bench`];
//! [`report`]; [`race`], the study; the command line.
//! The mathematics is in `docs/method.md`, the architecture in `ARCHITECTURE.md`.

pub mod backend;
pub mod bench;
pub mod cli;
pub mod config;
pub mod control;
pub mod cost;
pub mod digest;
pub mod error;
pub mod files;
pub mod formula;
pub mod model;
pub mod policy;
pub mod race;
pub mod real;
pub mod report;
pub mod rollout;
pub mod scenario;
pub mod studies;
pub mod system;
mod tile;
pub mod train;

#[doc(hidden)]
pub use race as experiment;

pub use error::{Error, Fault, Result};
