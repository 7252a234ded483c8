//! Ticks of an axis: where they stand, what they say, and the room that their labels take.

use super::span::{RoundValues, Span};

/// Width of a character of a label, at most.
pub(super) const CHARACTER: f64 = 7.6;
/// Height of a label, at most.
pub(super) const LINE: f64 = 16.2;
/// Distance of two ticks across, about.
const ACROSS: f64 = 52.0;
/// Distance of two ticks upwards, about.
const UP: f64 = 46.0;
/// Room between two labels, at least.
const GAP: f64 = 4.0;
/// Sizes that are written out; beyond these a label has a power of ten.
const PLAIN: [f64; 2] = [1e-3, 1e6];

/// Where ticks stand along an axis, ascending, and what they say.
pub(crate) type Ticks = Vec<(f64, String)>;

/// Ticks at round values, about `parts` of them and two at least.
pub(crate) fn round(span: Span, parts: f64) -> Ticks {
    let RoundValues { values, decimals } = span.ticks(parts);
    labelled(values, decimals)
}

/// Each value with its label.
fn labelled(values: Vec<f64>, decimals: usize) -> Ticks {
    let largest = values.iter().fold(0.0, |largest: f64, tick| largest.max(tick.abs()));
    values.into_iter().map(|tick| (tick, label(tick, decimals, largest))).collect()
}

/// Ticks along an axis `width` long, as many as have room for their labels.
pub(super) fn across(span: Span, width: f64) -> Ticks {
    let mut parts = (width / ACROSS).max(1.0);
    loop {
        let ticks = round(span, parts);
        let apart = width * step(&ticks) / span.width();
        if apart >= CHARACTER * longest(&ticks) + GAP || parts < 1.5 {
            return ticks;
        }
        parts *= 0.7;
    }
}

/// Ticks at whole numbers along an axis `width` long.
pub(super) fn whole(span: Span, width: f64) -> Ticks {
    let label = CHARACTER * span.high.abs().max(1.0).log10().ceil() + GAP;
    let parts = (width / label.max(ACROSS)).min(span.width()).max(1.0);
    let values = span.ticks(parts).values.into_iter().filter(|tick| tick.fract() == 0.0);
    labelled(values.collect(), 0)
}

/// Ticks along an axis `height` tall.
pub(super) fn up(span: Span, height: f64) -> Ticks {
    round(span, (height / UP).max(1.0))
}

/// Distance of the first two ticks.
fn step(ticks: &Ticks) -> f64 {
    ticks.windows(2).next().map_or(f64::INFINITY, |pair| pair[1].0 - pair[0].0)
}

/// The ticks without the labels that begin before `free`, or before the end of the one before.
pub(super) fn thinned(
    mut ticks: Ticks,
    mut free: f64,
    reach: impl Fn(f64, &str) -> [f64; 2],
) -> Ticks {
    for (tick, text) in &mut ticks {
        let [from, to] = reach(*tick, text);
        if from < free {
            text.clear();
        } else {
            free = to;
        }
    }
    ticks
}

/// Characters of the longest label.
pub(super) fn longest(ticks: &Ticks) -> f64 {
    let lengths = ticks.iter().map(|(_, text)| text.chars().count());
    lengths.max().unwrap_or(1) as f64
}

/// Half of the width of a label, at most.
pub(super) fn half(text: &str) -> f64 {
    CHARACTER * text.chars().count() as f64 / 2.0
}

/// A tick's value with a true minus sign; `largest` is the size of the largest along the axis.
fn label(tick: f64, decimals: usize, largest: f64) -> String {
    // Zero comes out of the multiplication as a tiny number, now and then.
    let tick = if tick.abs() < 1e-9 * largest { 0.0 } else { tick };
    let plain = (PLAIN[0]..PLAIN[1]).contains(&largest);
    let text = match tick == 0.0 && !plain {
        true => "0".to_owned(),
        false if plain => format!("{tick:.decimals$}"),
        false => scientific(tick),
    };
    text.replace('-', "−")
}

/// `value` with a power of ten, and no more digits than it has.
fn scientific(value: f64) -> String {
    let text = format!("{value:.6e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::{CHARACTER, across, longest, round, whole};
    use crate::report::span::Span;

    fn texts(span: [f64; 2], parts: f64) -> Vec<String> {
        let span = Span { low: span[0], high: span[1] };
        round(span, parts).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn labels_have_the_digits_that_tell_them_apart() {
        assert_eq!(texts([0.0, 2.0], 4.0), ["0.0", "0.5", "1.0", "1.5", "2.0"]);
        assert_eq!(texts([-1e-5, 1e-5], 2.0), ["−1e−5", "0", "1e−5"]);
        assert_eq!(texts([0.0, 3e-5], 6.0)[1..3], ["5e−6", "1e−5"]);
        assert_eq!(texts([1e6, 2e6], 4.0)[..2], ["1e6", "1.5e6"]);
        assert_eq!(texts([0.0, 4e-14], 2.0), ["0", "2e−14", "4e−14"]);
    }

    /// Of whatever span, an axis has two ticks, and labels that do not touch.
    #[test]
    fn every_axis_has_two_ticks() {
        for low in [-1.0, -0.3, 0.0, 0.0121, 0.9, 123.4, 1e5] {
            for width in [1e-4, 0.0059, 0.37, 1.0, 1.9, 8.0, 3e4] {
                let span = Span { low, high: low + width };
                for room in [60.0, 190.0, 370.0] {
                    let ticks = across(span, room);
                    assert!(ticks.len() >= 2, "{span:?} {room}: {ticks:?}");
                    let apart = room * (ticks[1].0 - ticks[0].0) / span.width();
                    let touch = apart < CHARACTER * longest(&ticks);
                    assert!(!touch || ticks.len() < 5, "{span:?} {room}: {ticks:?}");
                }
            }
        }
    }

    #[test]
    fn whole_numbers_are_whole() {
        let ticks = |low, high| -> Vec<String> {
            whole(Span { low, high }, 300.0).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(ticks(0.5, 1.5), ["1"]);
        assert_eq!(ticks(0.0, 1.0), ["0", "1"]);
        assert_eq!(ticks(0.0, 20_000.0), ["0", "5000", "10000", "15000", "20000"]);
    }
}
