//! How much a certificate takes at most, from its settings alone: said before a check of somebody else's.

use super::settings::Settings;

/// Rollouts that an enclosure of a ball costs as much as, at most: intervals and affine forms in f64, one
/// start at a time.
const ENCLOSURE: f64 = 1000.0;
/// Balls that are enclosed for a certified radius, by bisection.
const BALLS: f64 = 32.0;
/// Pairs and starts that a check draws besides for the claims on each.
const FRESH: f64 = 24_000.0;

/// Rollouts, or as many as the work costs, that a certificate of `settings` takes at most; a check makes it
/// again and tries its claims on as much once more.
fn most_rollouts(settings: &Settings) -> f64 {
    let Settings { deviation, global, growth, .. } = settings;
    let [columns, rows] = settings.slice_size().map(|size| size as f64);
    let judged = 2.0 * global.draws as f64 + columns * rows;
    let judged = if settings.enclosed.is_some() { ENCLOSURE * judged } else { judged };
    let pairs = deviation.scenarios as f64 + deviation.pilot as f64;
    let rounds = f64::from(growth.rounds) * growth.scenarios as f64 + growth.plan.pilot as f64;
    let whole_box = settings.whole_box.map_or(0.0, |_| global.draws as f64);
    let sequential = settings.sequential.as_ref().map_or(0.0, |asked| 2.0 * asked.most as f64);
    2.0 * pairs + judged + rounds + whole_box + sequential + drops(settings) + enclosed(settings)
}

/// Of margin drops: both pilots, pairs, and the shares of the sets.
fn drops(settings: &Settings) -> f64 {
    let Some(asked) = &settings.drops else { return 0.0 };
    let calibration = asked.calibration.map_or(0.0, |sample| sample.scenarios as f64);
    let pairs = 2.0 * asked.pilot as f64 + asked.sample.scenarios as f64 + calibration;
    2.0 * pairs + 3.0 * asked.share_draws as f64
}

/// Of the deterministic certificate.
fn enclosed(settings: &Settings) -> f64 {
    let Some(asked) = &settings.deterministic else { return 0.0 };
    ENCLOSURE * (asked.starts as f64 + BALLS * asked.radii as f64)
}

/// The same of a check, which draws fresh samples for every claim.
pub(crate) fn most_rollouts_of_check(settings: &Settings) -> f64 {
    2.0 * most_rollouts(settings) + FRESH
}
