//! The command line: reads arguments, runs a command, says what came of it by its exit code.

mod args;
mod bench;
mod certify;
mod devices;
mod inputs;
mod options;
mod policy;
mod progress;
mod race;
mod race_input;
mod remembered;
mod rollout;
mod scenarios;
mod stored;
mod summary;
mod sweep;
mod train;

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

use clap::Parser;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::files::json;
use args::{Arguments, Command, PolicyCommand};
use options::Global;

/// Version of the layout of each [`Document`].
const SCHEMA: u32 = 1;

/// What a command that ran to its end came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// All that was asked for.
    Done,
    /// The claim asked for was not obtained.
    NotObtained,
}

/// Runs the command line and returns its exit code: 0 done, 1 failed, 2 wrong usage,
/// configuration or input, 3 ran but the claim asked for was not obtained.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            // Help and version come this way too, with exit code 0. Nobody reads what a closed
            // pipe does not take.
            let _ = usage.print();
            return usage.exit_code() as u8;
        }
    };
    match dispatch(&arguments) {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::NotObtained) => 3,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {}", plain(&error.to_string()));
            error.exit_code()
        }
    }
}

/// Runs the command.
fn dispatch(arguments: &Arguments) -> Result<Outcome> {
    let global = &arguments.global();
    match &arguments.command {
        Command::Certify { config, .. } => certify::run(global, config),
        Command::Rollout { config, starts, measures, .. } => {
            rollout::run(global, config, starts, measures)
        }
        Command::Query { folder, states, .. } => stored::query(global, folder, states),
        Command::Check { folder } => stored::check(global, folder),
        Command::Race(asked) => race::run(global, asked),
        Command::Sweep(asked) => sweep::run(global, asked),
        Command::Train { config, method, .. } => train::run(global, config, *method),
        Command::Policy(PolicyCommand::Import(asked)) => policy::import(global, asked),
        Command::Policy(PolicyCommand::Inspect { file, config, .. }) => {
            policy::inspect(global, file, config.as_deref())
        }
        Command::Scenarios(asked) => scenarios::run(global, *asked),
        Command::Bench(asked) => bench::run(global, asked),
        Command::Devices => devices::list(global),
    }
}

/// A document of a command that is no record with a version of its own.
#[derive(Serialize)]
struct Document<'a, T> {
    schema: u32,
    #[serde(flatten)]
    content: &'a T,
}

/// `content` with the version of its layout.
fn document<T>(content: &T) -> Document<'_, T> {
    Document { schema: SCHEMA, content }
}

/// Prints `value` as JSON with `--json`, nothing with `-q`, else `text`.
fn report(global: &Global, value: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
    let text = match (global.common.json, global.common.quiet) {
        (true, _) => json("--json", value)?,
        (false, true) => return Ok(()),
        (false, false) => plain(&text()),
    };
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        // Whoever closed the pipe has read enough.
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::Write { path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

/// `text` for a terminal: what a name from a file could steer it with is replaced, line breaks and
/// tabs aside.
fn plain(text: &str) -> String {
    let steers =
        |c: char| c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let shown = |c: char| if steers(c) && c != '\n' && c != '\t' { '\u{fffd}' } else { c };
    text.chars().map(shown).collect()
}

/// The folder that `path` lies in.
fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}
