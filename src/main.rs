//! The `reachcast` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(reachcast::cli::run(std::env::args_os()))
}
