//! Intervals of data and round ticks along them.

use super::text::ordinary;

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

    /// Wider by `share` of its width on each side, and never empty.
    pub(crate) fn widened(self, share: f64) -> Self {
        let reach = share * (self.high - self.low);
        let least = 1e-6 * self.low.abs().max(self.high.abs()).max(1e-3);
        let reach = reach.max(if self.high - self.low > least { 0.0 } else { least });
        Self { low: self.low - reach, high: self.high + reach }
    }

    /// High end minus low end.
    pub(crate) fn width(self) -> f64 {
        self.high - self.low
    }

    /// At least `width` wide, about the same middle.
    pub(crate) fn stretched(self, width: f64) -> Self {
        self.widened(((width / self.width() - 1.0) / 2.0).max(0.0))
    }

    /// Round values about `parts` to the span.
    pub(crate) fn ticks(self, parts: f64) -> RoundValues {
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
}
