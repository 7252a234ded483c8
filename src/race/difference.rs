//! The interval of a difference of two rates on the same starts.

/// Tango's score interval of `(only_this - only_other) / starts` at the normal quantile `z`.
///
/// Counts are of starts where one of the two alone succeeded; they may be means over noise seeds, which
/// credits the averaging with nothing. The ends are where the score of a difference, with the discordant
/// shares that are likeliest under it, comes to `z`: few discordant starts leave room on both sides,
/// where a normal interval has next to none. Tango (1998), "Equivalence test and confidence interval for
/// the difference in proportions for the paired-sample design", Statistics in Medicine 17.
///
/// # Panics
/// If there is no start.
pub(super) fn interval(only_this: f64, only_other: f64, starts: f64, z: f64) -> [f64; 2] {
    assert!(starts > 0.0, "a difference over starts");
    let difference = (only_this - only_other) / starts;
    let exceeds = |delta: f64| score(only_this, only_other, starts, delta).abs() > z;
    [end(difference, -1.0, exceeds), end(difference, 1.0, exceeds)]
}

/// The farthest point from `inside` towards `outside` that does not exceed.
fn end(inside: f64, outside: f64, exceeds: impl Fn(f64) -> bool) -> f64 {
    if !exceeds(outside) {
        return outside;
    }
    let (mut inside, mut outside) = (inside, outside);
    loop {
        let middle = 0.5 * (inside + outside);
        if middle == inside || middle == outside {
            // The point that exceeds: outwards.
            return outside;
        }
        *(if exceeds(middle) { &mut outside } else { &mut inside }) = middle;
    }
}

/// How many standard deviations the difference lies from `delta`, were that the true one.
fn score(only_this: f64, only_other: f64, starts: f64, delta: f64) -> f64 {
    let distance = only_this - only_other - starts * delta;
    if distance == 0.0 {
        return 0.0;
    }
    // The likeliest share of starts where the other one alone succeeds, a root of a quadratic.
    let (a, c) = (2.0 * starts, -only_other * delta * (1.0 - delta));
    let b = -only_this - only_other + (2.0 * starts - only_this + only_other) * delta;
    let share = ((b * b - 4.0 * a * c).max(0.0).sqrt() - b) / (2.0 * a);
    let variance = starts * (2.0 * share + delta * (1.0 - delta));
    if variance > 0.0 { distance / variance.sqrt() } else { f64::INFINITY.copysign(distance) }
}

#[cfg(test)]
mod tests {
    use super::interval;

    const Z: f64 = 1.959_963_984_540_054;

    /// Fagerland, Lydersen and Laake (2014), "Recommended tests and confidence intervals for paired binomial
    /// proportions", and their program: before and after a transplantation, 1 and 7 of 21 children alone;
    /// before and after a therapy, 6 and 16 of 161 patients alone. Normal intervals are -0.520 to -0.052 and
    /// -0.1184 to -0.0058.
    #[test]
    fn published_intervals() {
        let rounded = |ends: [f64; 2], digits: f64| ends.map(|end| (end * digits).round() / digits);
        assert_eq!(rounded(interval(1.0, 7.0, 21.0, Z), 1e3), [-0.517, -0.026]);
        assert_eq!(rounded(interval(6.0, 16.0, 161.0, Z), 1e4), [-0.124, -0.0054]);
    }

    #[test]
    fn few_discordant_starts_leave_room() {
        // None at all: a normal interval would be a point.
        let [low, high] = interval(0.0, 0.0, 500.0, Z);
        assert!(low < -0.007 && high > 0.007 && low + high < 1e-9, "{low} {high}");
        let [low, high] = interval(0.2, 0.0, 500.0, Z);
        assert!(low < 0.0 && high > 0.0076, "{low} {high}");
        assert_eq!(interval(1.0, 0.0, 1.0, Z)[1], 1.0);
        assert_eq!(interval(30.0, 0.0, 30.0, Z)[1], 1.0);
    }

    #[test]
    fn a_difference_mirrors_and_lies_inside() {
        for (this, other, starts) in [(3.0, 9.0, 50.0), (40.0, 20.0, 160.0), (0.4, 1.8, 12.0)] {
            let ([low, high], mirrored) =
                (interval(this, other, starts, Z), interval(other, this, starts, Z));
            let difference = (this - other) / starts;
            assert!(low < difference && difference < high);
            assert!((low + mirrored[1]).abs() < 1e-9 && (high + mirrored[0]).abs() < 1e-9);
        }
    }
}
