//! Checks of a task, once, in front of both backends.

use crate::error::{Error, Result};
use crate::rollout::{Region, RolloutSpec, Starts, Tightening};

/// Refuses a range beyond its list of starts, a region whose sides have different lengths, and a
/// tightening that has not one entry per step.
///
/// # Errors
/// [`Error::Invalid`] with the figures.
pub(super) fn check_task(
    starts: &Starts<'_>,
    end: u64,
    tightening: &Tightening,
    spec: &RolloutSpec,
) -> Result<()> {
    if let Starts::Listed(list) = starts
        && end > list.len() as u64
    {
        let problem = format!("ends at {end}, but the list has {} starts", list.len());
        return Err(Error::invalid("range of starts", problem));
    }
    if let Starts::Drawn { region, .. } = starts {
        let [one, other] = match region {
            Region::Box { low, high } => [low.len(), high.len()],
            Region::Ball(ball) => [ball.center.len(), ball.varies.len()],
        };
        if one != other {
            let problem = format!("sides of {one} and {other} coordinates");
            return Err(Error::invalid("region of starts", problem));
        }
    }
    let steps = spec.horizon as usize + 1;
    for values in [&tightening.target, &tightening.constraint] {
        if values.len() != steps {
            let problem = format!("has {} values, expected {steps}, T + 1", values.len());
            return Err(Error::invalid("tightening", problem));
        }
    }
    Ok(())
}
