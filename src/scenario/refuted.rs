//! What fresh trials say of a claim: it is refuted only where they leave less than 1e-6 to chance.

use super::bound::{interval, lower_bound};
use super::finding::{Figure, Finding};

/// Chance that a check calls a true claim false, each.
pub(super) const FALSE_ALARM: f64 = 1e-6;

/// Whether `failures` of `trials` refute a risk of at most `risk`.
pub(super) fn refuted(name: &str, risk: f64, failures: u64, trials: u64) -> Finding {
    refuted_at(FALSE_ALARM, name, risk, failures, trials)
}

/// The same where a true claim is called false with probability at most `chance`.
pub(super) fn refuted_at(
    chance: f64,
    name: &str,
    risk: f64,
    failures: u64,
    trials: u64,
) -> Finding {
    let least = lower_bound(failures, trials, chance);
    Finding {
        name: name.to_owned(),
        stored: Figure::AtMost { at_most: risk },
        found: Figure::Trials { failures, trials, at_least: least },
        holds: least <= risk,
    }
}

/// Whether the stored interval of a share may hold the share that `inside` of `draws` fresh draws show.
///
/// Where the share lies in the stored interval, an interval around the fresh draws that misses it with
/// probability 1e-6 meets the stored one with that confidence, whatever the stored one's own.
pub(super) fn share(name: &str, [low, high]: [f64; 2], inside: u64, draws: u64) -> Finding {
    let (fresh_low, fresh_high) = interval(inside, draws, FALSE_ALARM);
    Finding {
        name: name.to_owned(),
        stored: Figure::Interval([low, high]),
        found: Figure::Interval([fresh_low, fresh_high]),
        holds: low <= fresh_high && fresh_low <= high,
    }
}
