//! `plan` from outside: closed loops against mathematics, the same bits, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

#[path = "../command/mod.rs"]
mod command;

mod judged;
mod optimum;
mod physics;
mod plants;
mod refused;
mod same_bits;
mod stopped;
