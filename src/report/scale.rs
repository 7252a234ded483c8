//! From values to places along an axis: linear, or logarithmic.

use super::plot::Axis;
use super::span::Span;
use super::text::{minus, number, shorten};
use super::ticks::Ticks;

/// Share of an axis that is left free at either end.
const EDGE: f64 = 0.08;
/// Characters of a tick's label.
const LABEL: usize = 7;

/// A scale: what it covers, in places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    log: bool,
    span: Span,
}

impl Scale {
    /// Linear between two values.
    pub(crate) fn linear(low: f64, high: f64) -> Self {
        Self { log: false, span: Span { low, high } }
    }

    /// Logarithmic if all values are positive, else from 0; `None` without values.
    pub(crate) fn log(values: &[f64]) -> Option<Self> {
        let span = Span::of(values.iter().copied())?;
        if span.low <= 0.0 {
            return Self::from_zero(values);
        }
        let span = Span { low: span.low.log10(), high: span.high.log10() };
        Some(Self { log: true, span: padded(span, 0.3) })
    }

    /// Logarithmic if the values span more than a decade, else linear; `None` without values.
    pub(crate) fn fitting(values: &[f64]) -> Option<Self> {
        let span = Span::of(values.iter().copied())?;
        if span.low > 0.0 && span.high > 10.0 * span.low {
            return Self::log(values);
        }
        let lone = 0.5 * if span.low == 0.0 { 1.0 } else { span.low.abs() };
        Some(Self { log: false, span: padded(span, lone) })
    }

    /// From 0 to a little above the largest value; `None` without values.
    pub(crate) fn from_zero(values: &[f64]) -> Option<Self> {
        let span = Span::of(values.iter().copied().chain([0.0]))?;
        let top = if span.high > 0.0 { span.high * (1.0 + EDGE) } else { 1.0 };
        (!values.is_empty()).then(|| Self::linear(span.low.min(0.0), top))
    }

    /// Whether it is logarithmic.
    pub(crate) fn is_log(self) -> bool {
        self.log
    }

    /// What it covers, in places.
    pub(crate) fn span(self) -> Span {
        self.span
    }

    /// Where `value` lies.
    pub(crate) fn place(self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    /// The axis with ticks at round values, about `parts` of them.
    pub(crate) fn axis(self, parts: f64) -> Axis {
        let values = if self.log { self.decades() } else { self.span.ticks(parts).values };
        self.axis_at(values.into_iter().map(|value| (value, tick(value))))
    }

    /// The axis with a tick at each of the values.
    pub(crate) fn axis_at(self, values: impl IntoIterator<Item = (f64, String)>) -> Axis {
        let ticks =
            values.into_iter().map(|(value, text)| (self.place(value), shorten(&text, LABEL)));
        Axis { span: self.span, ticks: ticks.collect::<Ticks>() }
    }

    /// Round values of a logarithmic scale: decades, or 1, 2 and 5 in each, or round numbers.
    fn decades(self) -> Vec<f64> {
        let [low, high] = [self.span.low, self.span.high].map(|place| 10.0_f64.powf(place));
        let first = self.span.low.floor() as i32;
        let last = (self.span.high.ceil() as i32).min(first + 400);
        let among = |digits: &[u8]| -> Vec<f64> {
            let all = (first..=last)
                .flat_map(|decade| digits.iter().map(move |digit| parsed(*digit, decade)));
            all.filter(|value| (low..=high).contains(value)).collect()
        };
        let enough = |ticks: &Vec<f64>| ticks.len() >= 3;
        let linear = || Span { low, high }.ticks(6.0).values;
        let choices = [among(&[1]), among(&[1, 2, 5])].into_iter();
        choices.into_iter().find(enough).unwrap_or_else(linear)
    }
}

/// With room at both ends; `lone` of it where there is but one value.
fn padded(span: Span, lone: f64) -> Span {
    if span.width() > 1e-6 * lone {
        return span.widened(EDGE);
    }
    Span { low: span.low - lone, high: span.high + lone }
}

/// `digit * 10^decade` to the last bit.
fn parsed(digit: u8, decade: i32) -> f64 {
    format!("{digit}e{decade}").parse().unwrap_or(f64::NAN)
}

/// A tick's label.
fn tick(value: f64) -> String {
    // Zero comes out of a multiplication as a tiny number, now and then.
    minus(&number(if value.abs() < 1e-12 { 0.0 } else { value }))
}

#[cfg(test)]
mod tests {
    use super::Scale;

    fn ticks(scale: Scale) -> Vec<String> {
        scale.axis(5.0).ticks.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn more_than_a_decade_is_logarithmic() {
        let fitting = |values: &[f64]| Scale::fitting(values).expect("numbers").is_log();
        assert!(!fitting(&[1.0, 10.0]));
        assert!(fitting(&[1.0, 10.1]));
        assert!(!fitting(&[0.0, 1.0, 100.0]));
        assert!(!fitting(&[-1.0, 100.0]));
        assert_eq!(Scale::fitting(&[f64::NAN]), None);
        assert_eq!(Scale::log(&[]), None);
        assert_eq!(Scale::from_zero(&[]), None);
        assert!(!Scale::log(&[0.0, 3.0]).expect("numbers").is_log());
    }

    #[test]
    fn a_lone_value_has_room_around_it() {
        let span = |scale: Option<Scale>| {
            let span = scale.expect("a number").span();
            [span.low, span.high]
        };
        assert_eq!(span(Scale::log(&[1.0, 1.0])), [-0.3, 0.3]);
        assert_eq!(span(Scale::fitting(&[4.0])), [2.0, 6.0]);
        assert_eq!(span(Scale::fitting(&[0.0])), [-0.5, 0.5]);
        assert_eq!(span(Scale::log(&[0.0])), [0.0, 1.0]);
    }

    #[test]
    fn ticks_are_round_numbers_of_the_span() {
        assert_eq!(ticks(Scale::log(&[0.5, 2e3]).expect("numbers")), ["1", "10", "100", "1000"]);
        assert_eq!(ticks(Scale::log(&[0.9, 12.0]).expect("numbers")), ["1", "2", "5", "10"]);
        assert_eq!(ticks(Scale::log(&[2.1, 2.9]).expect("numbers")), ["2.2", "2.4", "2.6", "2.8"]);
        assert_eq!(ticks(Scale::from_zero(&[4.0]).expect("numbers")), ["0", "1", "2", "3", "4"]);
    }
}
