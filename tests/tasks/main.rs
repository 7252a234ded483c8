//! Tasks against brute force, and in the words of the commands.

#[path = "../mutants/mod.rs"]
#[macro_use]
mod mutants;

mod cli;
#[path = "../command/mod.rs"]
mod command;
#[path = "../common/mod.rs"]
mod common;
mod kinds;
