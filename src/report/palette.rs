//! The colour scale of slices and heat maps: orange below zero, blue above, for light and dark.

use super::span::Span;

/// Steps of the scale on each side of zero.
pub(crate) const LEVELS: usize = 16;

/// Colours from next to zero to the end of the scale.
type Stops = [[u8; 3]; 4];

const LIGHT_BELOW: Stops = [[252, 240, 228], [240, 190, 140], [211, 118, 44], [125, 56, 0]];
const LIGHT_ABOVE: Stops = [[226, 238, 248], [150, 197, 230], [45, 127, 190], [4, 58, 110]];
const DARK_BELOW: Stops = [[58, 45, 36], [120, 72, 34], [208, 126, 58], [255, 208, 160]];
const DARK_ABOVE: Stops = [[32, 48, 64], [32, 88, 136], [72, 156, 220], [190, 226, 255]];

/// Class of a value: `n1..` at or below zero, `p1..` above, `nf` where it is not finite.
///
/// Steps are even in the square root of the value, so that small margins near zero show.
pub(crate) fn class(value: f64, limit: f64) -> String {
    if !super::text::ordinary(value) {
        return "nf".to_owned();
    }
    let position = (value.abs() / limit).sqrt() * LEVELS as f64;
    let level = (position.ceil() as usize).clamp(1, LEVELS);
    format!("{}{level}", if value > 0.0 { 'p' } else { 'n' })
}

/// Class of a value between `limits`, in even steps: `p1..`, one hue from light to strong.
pub(crate) fn even(value: f64, limits: Span) -> String {
    let share = (value - limits.low) / limits.width();
    format!("p{}", ((share * LEVELS as f64).ceil() as usize).clamp(1, LEVELS))
}

/// The style rules of the scale, light first, then dark for screens.
pub(crate) fn rules() -> String {
    format!(
        "{}\n@media screen and (prefers-color-scheme: dark) {{ {} }}\n",
        theme(LIGHT_BELOW, LIGHT_ABOVE),
        theme(DARK_BELOW, DARK_ABOVE)
    )
}

fn theme(below: Stops, above: Stops) -> String {
    let rule = |side: char, stops: Stops, level: usize| {
        let [red, green, blue] = mix(stops, (level - 1) as f64 / (LEVELS - 1) as f64);
        format!(".{side}{level}{{fill:#{red:02x}{green:02x}{blue:02x}}}")
    };
    (1..=LEVELS).map(|level| rule('n', below, level) + &rule('p', above, level)).collect()
}

/// The colour at `share` of the way through `stops`.
fn mix(stops: Stops, share: f64) -> [u8; 3] {
    let position = share * (stops.len() - 1) as f64;
    let index = (position as usize).min(stops.len() - 2);
    let weight = position - index as f64;
    std::array::from_fn(|channel| {
        let [low, high] = [stops[index], stops[index + 1]].map(|stop| f64::from(stop[channel]));
        (low + weight * (high - low)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::{LEVELS, class, even, rules};
    use crate::report::span::Span;

    #[test]
    fn the_sign_decides_the_side() {
        assert_eq!(class(0.0, 1.0), "n1");
        assert_eq!(class(1e-9, 1.0), "p1");
        assert_eq!(class(-1e-9, 1.0), "n1");
        assert_eq!(class(1.0, 1.0), format!("p{LEVELS}"));
        assert_eq!(class(-5.0, 1.0), format!("n{LEVELS}"));
        assert_eq!(class(-1e30, 1.0), "nf");
        assert_eq!(class(f64::NAN, 1.0), "nf");
    }

    #[test]
    fn even_steps_end_at_the_limits() {
        let limits = Span { low: 20.0, high: 36.0 };
        assert_eq!(even(20.0, limits), "p1");
        assert_eq!(even(21.5, limits), "p2");
        assert_eq!(even(36.0, limits), format!("p{LEVELS}"));
    }

    #[test]
    fn every_class_has_a_colour_in_both_themes() {
        let rules = rules();
        for level in 1..=LEVELS {
            for side in ['n', 'p'] {
                assert_eq!(rules.matches(&format!(".{side}{level}{{")).count(), 2);
            }
        }
    }
}
