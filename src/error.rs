//! The error type: what was wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Result with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong; each message names the place, the figure and the remedy.
///
/// Outcomes such as "no clean ball found" are not errors, see `scenario::Growth`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value in a configuration, an argument or a call is not usable.
    #[error("{place}: {problem}")]
    Invalid {
        /// The key or argument.
        place: String,
        /// What is wrong with it and what is expected.
        problem: String,
    },
    /// Fewer scenarios than the bound needs for the claim.
    #[error(
        "{have} scenarios cannot support risk {epsilon} with confidence 1 - {beta}: \
         {decision_vars} decision variable(s) need at least {need}"
    )]
    TooFewScenarios {
        /// Scenarios asked for.
        have: u64,
        /// The exact bound.
        need: u64,
        /// Risk.
        epsilon: f64,
        /// One minus the confidence, after any split over rounds.
        beta: f64,
        /// Decision variables of the scenario program.
        decision_vars: u32,
    },
    /// A file is missing, unreadable or damaged.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// An output could not be written.
    #[error("cannot write {}: {source}{}", path.display(), remedy(source))]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The disk has less room than the results need.
    #[error(
        "{}: the results need about {} of room, {} are free; make room there, or write to another \
         folder",
        folder.display(), size(*need), size(*free)
    )]
    NoRoom {
        /// The folder of the results.
        folder: PathBuf,
        /// Bytes that are to be written, estimated.
        need: u64,
        /// Bytes that are free.
        free: u64,
    },
    /// A device that was asked for is not there, or cannot hold the work.
    #[error("{0}")]
    Device(String),
    /// The device failed during the work.
    #[error("device failure ({fault}): {problem}")]
    DeviceFailed {
        /// How.
        fault: Fault,
        /// The adapter, and what it or its driver says.
        problem: String,
    },
    /// A stored certificate does not fit what it is used with.
    #[error("stored certificate refused: {0}")]
    Refused(String),
    /// Stopped by whoever watches the work; nothing half-written is left.
    #[error("interrupted; no result was written")]
    Interrupted,
}

/// How an adapter failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// It is gone: taken out, reset by the system, or its driver broke down.
    Lost,
    /// It has no memory left for a buffer or for the work.
    OutOfMemory,
    /// The driver refuses what it was given, or what it gave back is wrong.
    Validation,
    /// Work took longer than it may.
    Timeout,
    /// None was there to open.
    Absent,
    /// The work is larger than its limits.
    Unfit,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lost => "device lost",
            Self::OutOfMemory => "out of memory",
            Self::Validation => "validation error",
            Self::Timeout => "timeout",
            Self::Absent => "no adapter",
            Self::Unfit => "beyond the adapter's limits",
        })
    }
}

impl Error {
    /// An [`Error::Invalid`] at `place`.
    pub fn invalid(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { place: place.into(), problem: problem.into() }
    }

    /// An [`Error::File`] about `path`.
    pub fn file(path: &Path, problem: impl std::fmt::Display) -> Self {
        Self::File { path: path.to_owned(), problem: problem.to_string() }
    }

    /// What a program should exit with: 2 for wrong usage, configuration or input, 1 for failed work.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Invalid { .. }
            | Self::TooFewScenarios { .. }
            | Self::File { .. }
            | Self::Device(_)
            | Self::Refused(_) => 2,
            Self::Write { .. }
            | Self::NoRoom { .. }
            | Self::DeviceFailed { .. }
            | Self::Interrupted => 1,
        }
    }
}

/// What helps against a refusal of the system to write.
fn remedy(source: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match source.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "; make room there, or write to another folder, and run the command again"
        }
        ErrorKind::FileTooLarge => {
            "; a limit on the size of files is in the way (`ulimit -f`): raise it, and run the command \
             again"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "; make it writable, or write to another folder"
        }
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            "; a file is in the way: remove it, or write to another folder"
        }
        _ => "",
    }
}

/// A number of bytes in the unit that suits it.
fn size(bytes: u64) -> String {
    let scaled = |exponent: i32| bytes as f64 / 1024.0_f64.powi(exponent);
    match bytes {
        0..10_240 => format!("{bytes} bytes"),
        10_240..10_485_760 => format!("{:.0} KiB", scaled(1)),
        10_485_760..10_737_418_240 => format!("{:.0} MiB", scaled(2)),
        _ => format!("{:.1} GiB", scaled(3)),
    }
}
