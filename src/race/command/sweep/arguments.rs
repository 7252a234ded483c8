//! The arguments of `sweep`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::options::{Changes, Replace};

/// What `sweep` is asked for.
#[derive(Args, Clone, Debug)]
pub(crate) struct SweepArguments {
    /// Configuration (TOML)
    pub(crate) config: PathBuf,
    /// What each point is
    #[arg(long, value_enum, default_value_t = Of::Race)]
    pub(crate) of: Of,
    /// Any key of the configuration and its values; repeatable
    #[arg(long, value_name = "KEY=LIST")]
    pub(crate) vary: Vec<String>,
    /// Steps of a plan (races), or of a rollout (certificates)
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) horizon: Option<String>,
    /// Folder of the results [default: reachcast-sweep]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) replace: Replace,
    #[command(flatten, next_help_heading = "Races")]
    pub(crate) race: RaceAxes,
    #[command(flatten, next_help_heading = "Certificates")]
    pub(crate) certificate: CertificateAxes,
    #[command(flatten, next_help_heading = "Configuration")]
    pub(crate) changes: Changes,
}

/// What the points of a sweep are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Of {
    /// Races of one controller
    Race,
    /// Certificates
    Certificate,
}

/// Axes and options of a sweep of races.
#[derive(Args, Clone, Debug)]
pub(crate) struct RaceAxes {
    /// Controllers [default: mppi]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) controllers: Option<String>,
    /// Samples K of a plan
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) samples: Option<String>,
    /// Temperatures lambda of a plan, in units of cost
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) temperature: Option<String>,
    /// Standard deviations of the noise; a list in brackets has one for each control
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) sigma: Option<String>,
    /// How the noise hangs together over the steps
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) noise: Option<String>,
    /// Improvements of a plan at each control step
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) iterations: Option<String>,
    /// Starts: how many to draw from race.start_box, or a file, .npy or .csv [default: race.starts]
    #[arg(long, value_name = "N|FILE")]
    pub(crate) starts: Option<String>,
    /// Runs of each point, with the noise seeds SEED, SEED + 1, ... [default: 1]
    #[arg(long, value_name = "M")]
    pub(crate) noise_seeds: Option<u64>,
}

/// Axes of a sweep of certificates.
#[derive(Args, Clone, Debug)]
pub(crate) struct CertificateAxes {
    /// Risks epsilon of deviation bound and growth
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) epsilon: Option<String>,
    /// One minus the confidence of each claim
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) beta: Option<String>,
    /// Radii eps_x of the perturbation
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) radius: Option<String>,
    /// Deviation bounds: fixed-shape, variables, bonferroni, separate, exact
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) bound: Option<String>,
    /// Where the scenario counts come from: simple, exact (bounds), config [default: simple]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) count: Option<String>,
}
