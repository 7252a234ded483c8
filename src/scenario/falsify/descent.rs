//! Descent from a start: central differences of the measure by batch, and steps of many lengths at once.

use super::trials::{Candidate, Trials};
use crate::error::Result;

/// First reach of a step, of coordinates from -1 to 1.
const FIRST: f64 = 0.1;
/// Reach at which a descent ends: few spacings of f32.
const LAST: f64 = 1e-6;
/// Half the distance of a difference, of the reach.
const HALF: f64 = 0.25;
/// Step lengths tried at once, each half of the one before, the first twice the reach.
const LENGTHS: i32 = 8;
/// What the reach is multiplied by after a better start, and after none.
const BETTER: f64 = 1.5;
/// As above.
const WORSE: f64 = 0.3;

/// Goes down from `at` as long as the reach, the budget and the measure allow.
///
/// # Errors
/// Those of the trials.
pub(super) fn descend(trials: &mut Trials<'_>, mut at: Candidate) -> Result<()> {
    let mut reach = FIRST;
    while reach > LAST && !trials.is_over() {
        let slope = slope(trials, &at, HALF * reach)?;
        let Some(slope) = slope.filter(|_| !trials.is_over()) else { return Ok(()) };
        let length = |k: i32| reach * 2.0_f64.powi(1 - k);
        let step = |k: i32| at.u.iter().zip(&slope).map(|(u, s)| u - length(k) * s).collect();
        let tried = trials.run((0..LENGTHS).map(step).collect())?;
        match tried.into_iter().next().filter(|best| best.measure < at.measure) {
            Some(best) => {
                at = best;
                reach = (reach * BETTER).min(FIRST);
            }
            None => reach *= WORSE,
        }
    }
    Ok(())
}

/// The direction of the gradient at `at` by differences over `half` on either side; none where it is
/// flat, or where the budget did not suffice.
fn slope(trials: &mut Trials<'_>, at: &Candidate, half: f64) -> Result<Option<Vec<f64>>> {
    let moved = |i: usize, by: f64| {
        let mut u = at.u.clone();
        u[i] += by;
        u
    };
    let dimension = at.u.len();
    let both = (0..dimension).flat_map(|i| [moved(i, half), moved(i, -half)]).collect();
    let Some(measures) = trials.in_order(both)? else { return Ok(None) };
    let slope: Vec<f64> = measures.chunks_exact(2).map(|pair| pair[0] - pair[1]).collect();
    let length = slope.iter().map(|s| s * s).sum::<f64>().sqrt();
    let sloped = length > 0.0 && length.is_finite();
    Ok(sloped.then(|| slope.iter().map(|s| s / length).collect()))
}
