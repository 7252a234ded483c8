//! The program from outside: what it is asked, and what is left where it is stopped.

#[path = "../command/mod.rs"]
mod command;
#[path = "../common/mod.rs"]
mod common;

mod asked;
mod costs;
mod disk;
mod earlier;
mod endless;
mod faults;
mod init;
mod kept;
mod killed;
mod learned;
mod model_cli;
mod policy;
mod query;
mod registered;
mod train;
