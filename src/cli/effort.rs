//! What the check of a folder may cost, said before it starts and refused where it is out of all proportion.

use std::io::Write;

use super::options::Global;
use crate::bench::flops;
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rounding::upper;
use crate::scenario::most_rollouts_of_check;
use crate::scenario::settings::Settings;

/// Most operations of a check that nobody allowed more: minutes of a processor, an hour of a slow one.
pub(super) const USUAL: f64 = 1e13;

/// Says what a check takes at most.
///
/// # Errors
/// [`Error::Refused`] for more than `most` operations, with the figure and the option that allows for them.
pub(super) fn say(global: &Global, plant: &Plant, settings: &Settings, most: f64) -> Result<()> {
    let (rollouts, steps) = (most_rollouts_of_check(settings), settings.spec.horizon);
    let operations = rollouts * flops::rollout(plant, f64::from(steps));
    let words = format!(
        "at most {} rollouts of {steps} steps, {} operations",
        upper(rollouts),
        upper(operations)
    );
    // A figure that is none is beyond every limit.
    if operations <= most {
        if !global.common.quiet {
            // Whatever becomes of standard error, the work is done.
            let _ = writeln!(std::io::stderr(), "check: {words}");
        }
        return Ok(());
    }
    Err(Error::Refused(format!(
        "checking it takes {words}, more than {}; `--effort {}` allows for them",
        upper(most),
        upper(operations)
    )))
}
