//! The least ball that f32 has points enough for.

use super::sampling::spacing;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::rollout::Ball;
use crate::rounding::{number, upper};
#[cfg(feature = "cli")]
use crate::system::Axis;

/// Spacings of the largest coordinate that a radius has at least: with fewer, draws from a ball fall on
/// a coarse grid, and are not the uniform ones that a claim speaks of.
const LEAST: f64 = 4_000.0;

/// The least radius of a ball whose coordinates that vary come to these numbers.
fn least_radius(coordinates: impl Iterator<Item = f32>) -> f64 {
    let largest = coordinates.map(|x| f64::from(x.abs())).fold(0.0, f64::max);
    LEAST * spacing(largest)
}

/// The least radius of a perturbation of starts between the ends of `axes`.
#[cfg(feature = "cli")]
pub(crate) fn least_perturbation(axes: &[Axis]) -> f64 {
    least_radius(axes.iter().flat_map(|axis| [axis.low, axis.high]))
}

/// Whether f32 has points enough for the ball.
pub(super) fn is_fine(ball: &Ball) -> bool {
    let vary = ball.center.iter().zip(&ball.varies).filter(|(_, varies)| **varies);
    f64::from(ball.radius) >= least_radius(vary.map(|(x, _)| *x))
}

/// Refuses the radius at `key` where f32 is too coarse for the `smallest` one that follows from it, `varies` in
/// the box of `settings`.
fn check_radius(
    key: &str,
    [radius, smallest]: [f32; 2],
    settings: &Settings,
    varies: &[bool],
) -> Result<()> {
    let sides = settings.low.iter().zip(&settings.high).zip(varies);
    let vary = sides.filter(|(_, varies)| **varies);
    let least = least_radius(vary.flat_map(|((low, high), _)| [*low, *high]));
    if f64::from(smallest) >= least {
        return Ok(());
    }
    let what = if smallest < radius {
        format!("of the radii up to {radius}, the first one, {},", number(f64::from(smallest)))
    } else {
        radius.to_string()
    };
    let enough = upper(least * f64::from(radius) / f64::from(smallest));
    let problem = format!(
        "{what} is below {}, {LEAST} times the distance of neighbouring f32 at the largest coordinate \
         of the box: draws would not be uniform; take {enough} or more, or coordinates relative to an \
         origin nearby",
        upper(least)
    );
    Err(Error::invalid(key, problem))
}

/// Refuses radii that f32 is too coarse for; a perturbation moves every coordinate.
pub(super) fn check(settings: &Settings) -> Result<()> {
    let all = vec![true; settings.low.len()];
    let (deviation, growth) = (&settings.deviation, &settings.growth);
    check_radius("deviation.radius", [deviation.radius; 2], settings, &all)?;
    let radii = [growth.radius, growth.first_radius()];
    check_radius("growth.radius", radii, settings, &growth.varies)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_radius_follows_the_largest_coordinate_that_varies() {
        let ball = |radius: f32, varies: [bool; 2]| Ball {
            center: vec![1.0, 1e5],
            radius,
            varies: varies.to_vec(),
        };
        // Around 1 f32 lie 2^-23 apart, around 1e5 2^-7.
        let near = 4_000.0 * f32::EPSILON;
        assert!(is_fine(&ball(near, [true, false])));
        assert!(!is_fine(&ball(near.next_down(), [true, false])));
        assert!(is_fine(&ball(31.25, [true, true])) && !is_fine(&ball(31.0, [true, true])));
    }
}
