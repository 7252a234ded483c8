//! The arguments of `sweep`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::options::{Changes, Replace};

/// What `sweep` is asked for.
#[derive(Args, Clone, Debug)]
pub(crate) struct SweepArguments {
    /// Configuration (TOML)
    pub(in crate::race::command) config: PathBuf,
    /// What each point is
    #[arg(long, value_enum, default_value_t = Of::Race)]
    pub(in crate::race::command) of: Of,
    /// Any key of the configuration and its values; repeatable
    #[arg(long, value_name = "KEY=LIST")]
    pub(in crate::race::command) vary: Vec<String>,
    /// Steps of a plan (races), or of a rollout (certificates)
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) horizon: Option<String>,
    /// Folder of the results [default: reachcast-sweep]
    #[arg(long, value_name = "DIR")]
    pub(in crate::race::command) out: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::race::command) replace: Replace,
    #[command(flatten, next_help_heading = "Races")]
    pub(in crate::race::command) race: RaceAxes,
    #[command(flatten, next_help_heading = "Certificates")]
    pub(in crate::race::command) certificate: CertificateAxes,
    #[command(flatten, next_help_heading = "Configuration")]
    pub(in crate::race::command) changes: Changes,
}

/// What the points of a sweep are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::race::command) enum Of {
    /// Races of one controller
    Race,
    /// Certificates
    Certificate,
}

/// Axes and options of a sweep of races.
#[derive(Args, Clone, Debug)]
pub(in crate::race::command) struct RaceAxes {
    /// Controllers [default: mppi]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) controllers: Option<String>,
    /// Samples K of a plan
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) samples: Option<String>,
    /// Temperatures lambda of a plan, in units of cost
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) temperature: Option<String>,
    /// Standard deviations of the noise; a list in brackets has one for each control
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) sigma: Option<String>,
    /// How the noise hangs together over the steps
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) noise: Option<String>,
    /// Improvements of a plan at each control step
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) iterations: Option<String>,
    /// Starts: how many to draw from race.start_box, or a file, .npy or .csv [default: race.starts]
    #[arg(long, value_name = "N|FILE")]
    pub(in crate::race::command) starts: Option<String>,
    /// Runs of each point, with the noise seeds SEED, SEED + 1, ... [default: 1]
    #[arg(long, value_name = "M")]
    pub(in crate::race::command) noise_seeds: Option<u64>,
}

/// Axes of a sweep of certificates.
#[derive(Args, Clone, Debug)]
pub(in crate::race::command) struct CertificateAxes {
    /// Risks epsilon of deviation bound and growth
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) epsilon: Option<String>,
    /// One minus the confidence of each claim
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) beta: Option<String>,
    /// Radii eps_x of the perturbation
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) radius: Option<String>,
    /// Deviation bounds: fixed-shape, variables, bonferroni, separate, exact
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) bound: Option<String>,
    /// Where the scenario counts come from: simple, exact (bounds), config [default: simple]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(in crate::race::command) count: Option<String>,
}
