//! Judges: whether a race was won safely, and how it was lost otherwise.

use serde::{Deserialize, Serialize};

/// The rules by which a race is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Judge {
    /// The published code's.
    Study,
    /// As printed in the paper.
    Paper,
    /// As `Paper`, with the cone in its distance form.
    Rigorous,
}

/// How a race was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureClass {
    /// The judge's rules were violated before anyone moved.
    UnsafeStart,
    /// Too close to the opponent.
    Collision,
    /// Outside the fences that lead to the gate.
    Fence,
    /// Crossed the gate's plane outside the gate.
    MissedGate,
    /// The opponent was at or past the gate's plane first, or level with the ego.
    Overtaken,
    /// Did not cross the plane in time.
    Timeout,
}
