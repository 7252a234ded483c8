//! The command line: reads arguments, runs a command, says what came of it by its exit code.

mod args;
mod bench;
mod caveats;
mod certify;
pub(crate) mod devices;
mod effort;
mod evaluate;
mod export;
mod falsified;
mod falsify;
mod init;
pub(crate) mod inputs;
pub(crate) mod options;
mod output;
mod plan;
mod planned;
mod policy;
pub(crate) mod progress;
mod replayed;
mod rollout;
mod scenarios;
mod stored;
mod summary;
mod train;
mod values;

use std::ffi::OsString;
use std::io::Write;

use clap::Parser;

use crate::config::Registry;
use crate::error::{Error, Result};
use args::{Arguments, Command, PolicyCommand};
use output::plain;
pub(crate) use output::{Outcome, document, folder_of, report};

/// Runs the command line and returns its exit code: 0 done, 1 failed, 2 wrong usage,
/// configuration or input, 3 ran but the claim asked for was not obtained.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    run_with(&Registry::new(), arguments)
}

/// The same for a program with plants of its own, which `[system] name = "..."` asks for: every command
/// that works for any plant works for them. `examples/program.rs` is such a program.
pub fn run_with(registry: &Registry, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            // Help and version come this way too, with exit code 0. Nobody reads what a closed
            // pipe does not take.
            let _ = usage.print();
            return usage.exit_code() as u8;
        }
    };
    match dispatch(registry, &arguments) {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::NotObtained) => 3,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {}", plain(&told(&error)));
            error.exit_code()
        }
    }
}

/// The error with what the options of the command line can do about it.
fn told(error: &Error) -> String {
    let remedy = match error {
        Error::DeviceFailed { .. } => {
            "; `--fallback` goes on on the CPU where an adapter fails, `--backend cpu` starts there"
        }
        Error::Interrupted => {
            " (what `race`, `sweep`, `train` and `bench --out` have done is kept)"
        }
        _ => "",
    };
    format!("{error}{remedy}")
}

/// Runs the command.
fn dispatch(registry: &Registry, arguments: &Arguments) -> Result<Outcome> {
    let global = &arguments.global(registry);
    match &arguments.command {
        Command::Certify { config, .. } => certify::run(global, config),
        Command::Rollout { config, starts, measures, .. } => {
            rollout::run(global, config, starts, measures)
        }
        Command::Query { folder, states, .. } => stored::query(global, folder, states),
        Command::Check { folder, fresh_seed, effort } => {
            stored::check(global, folder, *fresh_seed, *effort)
        }
        Command::Falsify(asked) => falsify::run(global, asked),
        Command::Plan { config, .. } => plan::run(global, config),
        Command::Init(asked) => init::run(global, asked),
        Command::Study(asked) => asked.run(global),
        Command::Train { config, method, .. } => train::run(global, config, *method),
        Command::Policy(PolicyCommand::Import(asked)) => policy::import(global, asked),
        Command::Policy(PolicyCommand::Eval(asked)) => evaluate::run(global, asked),
        Command::Policy(PolicyCommand::Export(asked)) => export::run(global, asked),
        Command::Policy(PolicyCommand::Inspect { file, config, .. }) => {
            policy::inspect(global, file, config.as_deref())
        }
        Command::Scenarios(asked) => scenarios::run(global, *asked),
        Command::Bench(asked) => bench::run(global, asked),
        Command::Devices => devices::list(global),
    }
}

#[cfg(test)]
mod tests {
    use super::told;
    use crate::error::{Error, Fault};

    #[test]
    fn a_failed_adapter_is_told_with_the_options_that_help() {
        let error = Error::DeviceFailed { fault: Fault::Timeout, problem: "an adapter".to_owned() };
        let text = told(&error);
        assert!(text.starts_with(&error.to_string()), "{text}");
        assert!(text.contains("`--fallback`") && text.contains("`--backend cpu`"), "{text}");
        assert_eq!(told(&Error::Refused("no".to_owned())), "stored certificate refused: no");
    }
}
