//! Checks of a task, once, in front of both backends.

use crate::error::{Error, Result};
use crate::rollout::{Region, RolloutSpec, Starts, Tightening};

/// Refuses a horizon or discount out of range, a range beyond its list of starts, a region whose sides
/// have different lengths, and a tightening that has not one entry per step.
///
/// # Errors
/// [`Error::Invalid`] with the figures.
pub(super) fn check_task(
    starts: &Starts<'_>,
    end: u64,
    tightening: &Tightening,
    spec: &RolloutSpec,
) -> Result<()> {
    spec.check()?;
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
            Region::Ellipsoid(set) => [set.center.len(), set.half_axes.len()],
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::{MAX_HORIZON, States};

    #[test]
    fn specifications_made_by_hand_are_checked() {
        let refusal = |horizon: u32, gamma: f32| {
            let spec = RolloutSpec { horizon, gamma };
            let starts = Starts::Listed(States::one(&[0.0]));
            check_task(&starts, 1, &Tightening::none(&spec), &spec)
        };
        refusal(5, 1.0).expect("a specification");
        for (horizon, gamma, words) in [
            (0, 1.0, "horizon: 0 is not within"),
            (MAX_HORIZON + 1, 1.0, "horizon: 10001 is not within"),
            (5, 0.0, "gamma: 0 is outside"),
            (5, -0.5, "gamma: -0.5 is outside"),
            (5, 1.5, "gamma: 1.5 is outside"),
            (5, f32::NAN, "gamma: NaN is outside"),
        ] {
            let found = refusal(horizon, gamma).expect_err(words).to_string();
            assert!(found.contains(words), "no `{words}` in: {found}");
        }
    }
}
