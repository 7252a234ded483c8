//! The arguments of `race`.

use std::path::PathBuf;

use clap::Args;

use crate::cli::options::{Changes, Replace};

/// What `race` is asked for.
#[derive(Args, Clone, Debug)]
pub(crate) struct RaceArguments {
    /// Configuration (TOML)
    pub(in crate::race::command) config: PathBuf,
    /// Controllers, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "all")]
    pub(in crate::race::command) controllers: Vec<String>,
    /// Starts: how many to draw from race.start_box, or a file, .npy or .csv [default: race.starts]
    #[arg(long, value_name = "N|FILE")]
    pub(in crate::race::command) starts: Option<String>,
    /// Runs of each controller, with the noise seeds SEED, SEED + 1, ...
    #[arg(long, value_name = "M", default_value_t = 1)]
    pub(in crate::race::command) noise_seeds: u64,
    /// Folder of the results [default: reachcast-race]
    #[arg(long, value_name = "DIR")]
    pub(in crate::race::command) out: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::race::command) replace: Replace,
    #[command(flatten, next_help_heading = "Configuration")]
    pub(in crate::race::command) changes: Changes,
}
