//! Certificates, boxes and searches through the commands, and records that were edited.

mod certify;
mod claims;
#[path = "../command/mod.rs"]
mod command;
#[path = "../common/mod.rs"]
mod common;
mod enclosed;
mod falsify;
mod tamper;
