//! The commands of the study: `race`, and `sweep`, which certifies the points of a grid as well.

mod arguments;
mod input;
mod race;
mod sweep;

use clap::Subcommand;

use crate::cli::Outcome;
use crate::cli::options::{Global, Own};
use crate::error::Result;
use arguments::RaceArguments;
use sweep::SweepArguments;

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum StudyCommand {
    /// Fly whole races under many controllers, judge and compare them
    ///
    /// Writes results.json, report.html, timing.json, and states, controls and logs of every race
    /// as races/CONTROLLER-seedS-fromN.npz to the folder of --out (default: reachcast-race). Stopped
    /// half-way, the same command goes on where it was; the results are the same.
    #[command(after_help = "\
Controllers: hybrid, hybrid-no-policy, mppi, mppi-soft, mppi-cbf, mppi-warmstart, policy, ppo-cbf
(all of these: all). The hybrid without one of its parts: hybrid-no-global, hybrid-no-local,
hybrid-no-recovery, hybrid-no-policy, hybrid-no-safety (with hybrid: ablations). The hybrid with one
thing as in the study: hybrid-no-safety, hybrid-no-fences, hybrid-one-iteration, hybrid-study-start,
hybrid-study-recovery, hybrid-value (with hybrid: improvements).

Examples:
  reachcast race configs/race.toml
  reachcast race configs/race.toml --profile study --controllers hybrid,mppi --noise-seeds 5
  reachcast race configs/race.toml --controllers ablations --starts 2000 --out ablations")]
    Race(RaceArguments),
    /// Race or certify every point of a grid of settings
    ///
    /// Writes sweep.csv and sweep.parquet as points are done, then sweep.json and report.html, to the
    /// folder of --out (default: reachcast-sweep). Stopped half-way, the same command goes on where it
    /// was; points that are stored are not computed again, also after a grid was extended.
    #[command(after_help = "\
Every option that takes a LIST is an axis of the grid; the values of one axis are separated by commas.
What is not an axis has the value of the configuration.

Races (--of race): every point flies the same starts with the same noise seeds; axes --controllers,
--samples, --horizon, --temperature, --sigma, --noise, --iterations, --vary. An axis of plans changes
all plans of the controller, for the hybrid those of tiers 0 and 3. A noise is `independent`,
`colored:TIME` or `spline:KNOTS`.

Certificates (--of certificate): axes --epsilon, --beta, --radius, --horizon, --bound, --count, --vary.

Examples:
  reachcast sweep configs/race.toml --samples 16,64,256,1024,4096 --horizon 10,20,30 --starts 100
  reachcast sweep configs/race.toml --controllers hybrid,mppi --noise independent,colored:3,spline:5
  reachcast sweep configs/race.toml --vary race.mppi.cost.speed=0.5,1,2 --noise-seeds 5
  reachcast sweep configs/race.toml --of certificate --epsilon 0.05,0.1,0.2 --radius 0.02,0.05,0.1
  reachcast sweep configs/race.toml --of certificate --bound fixed-shape,variables,exact")]
    Sweep(Box<SweepArguments>),
}

impl StudyCommand {
    /// What lies over the configuration, where the results go and whether they may replace others.
    pub(crate) fn options(&self) -> Own {
        let (changes, out, replace) = match self {
            Self::Race(asked) => (&asked.changes, &asked.out, asked.replace),
            Self::Sweep(asked) => (&asked.changes, &asked.out, asked.replace),
        };
        Own { changes: changes.clone(), out: out.clone(), replace }
    }

    /// Runs the command.
    pub(crate) fn run(&self, global: &Global) -> Result<Outcome> {
        match self {
            Self::Race(asked) => race::run(global, asked),
            Self::Sweep(asked) => sweep::run(global, asked),
        }
    }
}
