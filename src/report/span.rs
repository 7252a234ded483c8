//! Intervals of data and round ticks along them.

use super::text::ordinary;

/// Width, in sizes of its ends, up to which a span is one value: f32 tells no more apart.
const LONE: f64 = 1e-6;
/// Width, in sizes of its ends, up to which a span is no change that a reader would see.
const CHANGE: f64 = 0.02;

/// An interval of data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// Lower end.
    pub(crate) low: f64,
    /// Upper end.
    pub(crate) high: f64,
}

/// Round values along a span.
pub(crate) struct RoundValues {
    /// The values, rising.
    pub(crate) values: Vec<f64>,
    /// Decimals that tell them apart.
    pub(crate) decimals: usize,
}

impl Span {
    /// The span of the values that can be drawn; `None` without any.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        values
            .into_iter()
            .filter(|&value| ordinary(value))
            .map(|value| Self { low: value, high: value })
            .reduce(Self::join)
    }

    /// The smallest span that holds both.
    pub(crate) fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Wider by `share` of its width on each side; around a lone value as wide as that is large, or as 1.
    pub(crate) fn widened(self, share: f64) -> Self {
        let size = self.size();
        let lone = self.width() <= LONE * size;
        let reach = match lone {
            true if size > 0.0 => size,
            true => 1.0,
            false => share * self.width(),
        };
        Self { low: self.low - reach, high: self.high + reach }
    }

    /// Not thinner than what a reader takes for a change.
    pub(crate) fn opened(self) -> Self {
        let least = CHANGE * self.size();
        match self.width() > LONE * self.size() && self.width() < least {
            true => self.stretched(least),
            false => self,
        }
    }

    /// Size of the larger end.
    fn size(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// High end minus low end.
    pub(crate) fn width(self) -> f64 {
        self.high - self.low
    }

    /// At least `width` wide, about the same middle.
    pub(crate) fn stretched(self, width: f64) -> Self {
        self.widened(((width / self.width() - 1.0) / 2.0).max(0.0))
    }

    /// Round values about `parts` to the span, and two at least: fewer do not tell how long it is.
    pub(crate) fn ticks(self, parts: f64) -> RoundValues {
        let finer = [1.0, 1.5, 2.0, 3.0].into_iter().map(|more| self.about(more * parts));
        let enough = finer.into_iter().find(|found| found.values.len() >= 2);
        enough.unwrap_or_else(|| self.about(5.0 * parts))
    }

    /// Round values about `parts` to the span.
    fn about(self, parts: f64) -> RoundValues {
        let rough = self.width() / parts;
        let power = 10.0_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|factor| factor * power)
            .into_iter()
            .find(|&step| step >= rough * 0.999)
            .unwrap_or(10.0 * power);
        let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
        let slack = 1e-9 * self.width();
        let first = ((self.low - slack) / step).ceil();
        let ticks = (0..=(2.0 * parts) as usize + 2)
            .map(|index| (first + index as f64) * step)
            .take_while(|&tick| tick <= self.high + slack);
        RoundValues { values: ticks.collect(), decimals }
    }
}

#[cfg(test)]
mod tests {
    use super::{RoundValues, Span};

    #[test]
    fn ticks_are_round_and_inside() {
        let span = Span { low: -2.65, high: -0.05 };
        let RoundValues { values: ticks, decimals } = span.ticks(6.0);
        assert_eq!(decimals, 1);
        assert_eq!(ticks.len(), 5);
        for (tick, expected) in ticks.iter().zip([-2.5, -2.0, -1.5, -1.0, -0.5]) {
            assert!((tick - expected).abs() < 1e-12, "{tick}");
        }
    }

    #[test]
    fn a_constant_has_room_of_its_size() {
        let around = |low, high| {
            let span = Span { low, high }.opened().widened(0.08);
            [span.low, span.high]
        };
        assert_eq!(around(0.0, 0.0), [-1.0, 1.0]);
        assert_eq!(around(-1.0, -1.0), [-2.0, 0.0]);
        assert_eq!(around(0.015, 0.015), [0.0, 0.03]);
        let [low, high] = around(1.0, 1.001);
        assert!((0.01..0.03).contains(&(high - low)), "{low} to {high}");
    }
}
