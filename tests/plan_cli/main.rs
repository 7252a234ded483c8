//! `plan` from outside: closed loops against mathematics, the same bits, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

#[path = "../chromium/mod.rs"]
mod chromium;
#[path = "../command/mod.rs"]
mod command;
#[path = "../page/mod.rs"]
mod page;

mod carried;
mod judged;
mod optimum;
mod physics;
mod plants;
mod refused;
mod report;
mod same_bits;
mod stopped;
mod stored;
