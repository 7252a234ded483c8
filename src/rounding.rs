//! Figures in few digits, each rounded to the side that keeps what is said with it true.
//!
//! Risks, bounds, losses and upper ends go up; radii, shares that are claimed and lower ends go down;
//! intervals go outwards. What is measured and not claimed goes to the nearest. No sentence, line of a
//! terminal or page rounds a claimed figure in any other way.

/// Beyond this a number stands for "not finite": `rollout::HUGE`, also discounted or scaled.
const ORDINARY: f64 = 1.0e20;
/// Significant digits after the first.
const DIGITS: usize = 3;
/// Decimals beyond which `1 - x` is written as a difference: an f64 near 1 has no more.
const DECIMALS: usize = 14;

/// Which way the last digit goes.
#[derive(Clone, Copy, PartialEq)]
enum Rounding {
    Nearest,
    Up,
    Down,
}

/// Whether `value` is a number that can be drawn.
pub(crate) fn ordinary(value: f64) -> bool {
    value.abs() < ORDINARY
}

/// Four significant digits, to the nearest: for what is measured, and claimed by nobody.
pub(crate) fn number(value: f64) -> String {
    rounded(value, Rounding::Nearest)
}

/// Four significant digits, never below `value`: for risks and bounds.
pub(crate) fn upper(value: f64) -> String {
    rounded(value, Rounding::Up)
}

/// Four significant digits, never above `value`: for certified radii and lower ends.
pub(crate) fn lower(value: f64) -> String {
    rounded(value, Rounding::Down)
}

/// `[low, high]`, rounded outwards.
pub(crate) fn interval([low, high]: [f64; 2]) -> String {
    format!("{} to {}", lower(low), upper(high))
}

/// As [`upper`], for weights and their like, which are not taken for infinite because they are large.
#[cfg(feature = "cli")]
pub(crate) fn finite_upper(value: f64) -> String {
    finite(value, Rounding::Up)
}

/// As [`lower`], for weights and their like.
#[cfg(feature = "cli")]
pub(crate) fn finite_lower(value: f64) -> String {
    finite(value, Rounding::Down)
}

/// As [`interval`], for weights and their like.
#[cfg(feature = "cli")]
pub(crate) fn finite_interval([low, high]: [f64; 2]) -> String {
    format!("{} to {}", finite_lower(low), finite_upper(high))
}

/// `1 - beta` in words, never above the confidence that `beta` leaves.
pub(crate) fn confidence(beta: f64) -> String {
    format!("1 - {}", upper(beta))
}

/// `1 - share` in the decimals that `share` has, so that 0.9 stands for one less 0.1: exact, and
/// where that takes more decimals than an f64 has, the difference as it is.
pub(crate) fn complement(share: f64) -> String {
    let text = share.to_string();
    match text.split_once('.').map_or(0, |(_, decimals)| decimals.len()) {
        decimals @ 0..=DECIMALS => format!("{:.decimals$}", 1.0 - share),
        _ => format!("1 - {text}"),
    }
}

fn rounded(value: f64, rounding: Rounding) -> String {
    if ordinary(value) { finite(value, rounding) } else { "not finite".to_owned() }
}

/// The same for any number that is finite.
fn finite(value: f64, rounding: Rounding) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let (mut mantissa, mut exponent) = scientific(value);
    let shown = decimal(mantissa, exponent);
    // A decimal such as 0.1 is not its own double; only a real difference moves the last digit.
    let slack = value.abs() * 1e-12;
    match rounding {
        Rounding::Up if shown < value - slack => mantissa += 1,
        Rounding::Down if shown > value + slack => mantissa -= 1,
        _ => {}
    }
    if mantissa.abs() == 10_i64.pow(DIGITS as u32 + 1) {
        mantissa /= 10;
        exponent += 1;
    }
    written(mantissa, exponent)
}

/// `value` as `mantissa * 10^(exponent - DIGITS)`.
fn scientific(value: f64) -> (i64, i32) {
    let text = format!("{value:.DIGITS$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.replace('.', "").parse().unwrap_or(0);
    (mantissa, exponent.parse().unwrap_or(0))
}

fn decimal(mantissa: i64, exponent: i32) -> f64 {
    format!("{mantissa}e{}", exponent - DIGITS as i32).parse().unwrap_or(0.0)
}

fn written(mantissa: i64, exponent: i32) -> String {
    let value = decimal(mantissa, exponent);
    if (-4..6).contains(&exponent) {
        let places = usize::try_from(DIGITS as i32 - exponent).unwrap_or(0);
        return trimmed(&format!("{value:.places$}"));
    }
    let text = format!("{value:.DIGITS$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{exponent}", trimmed(mantissa))
}

/// Without the zeros that end a decimal fraction.
fn trimmed(text: &str) -> String {
    if !text.contains('.') {
        return text.to_owned();
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The shortest decimal that is this f32, so that a record says 0.4 and not 0.4000000059604645; as an
/// f32 it is `value` again.
pub(crate) fn as_written(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::{complement, confidence, interval, lower, number, upper};

    #[test]
    fn numbers_are_short_and_rounded_the_safe_way() {
        assert_eq!(number(0.1), "0.1");
        assert_eq!(number(-2.0), "-2");
        assert_eq!(number(0.042_791), "0.04279");
        assert_eq!(upper(0.042_791), "0.0428");
        assert_eq!(upper(0.1), "0.1");
        assert_eq!(upper(0.3 - 0.1), "0.2");
        assert_eq!(lower(0.369_99), "0.3699");
        assert_eq!(upper(-0.369_99), "-0.3699");
        assert_eq!(upper(0.999_91), "1");
        assert_eq!(number(1e-9), "1e-9");
        assert_eq!(number(1.234_56e9), "1.235e9");
        assert_eq!(number(43_447.0), "43450");
        assert_eq!(interval([0.123_46, 0.123_46]), "0.1234 to 0.1235");
    }

    #[test]
    fn what_is_not_finite_says_so() {
        for value in [f64::NAN, f64::INFINITY, -1e30, 14.0 * 1e30] {
            assert_eq!(number(value), "not finite");
        }
    }

    /// Whatever is printed is on the safe side of what it stands for, up to the last digits of an f64.
    #[test]
    fn no_printed_figure_claims_more_than_its_number() {
        let mut value = 1.234_567_890_123e-9;
        while value < 1e9 {
            let read = |text: String| text.parse::<f64>().unwrap();
            let slack = 1e-12 * value;
            assert!(read(upper(value)) >= value - slack, "{value} up is {}", upper(value));
            assert!(read(lower(value)) <= value + slack, "{value} down is {}", lower(value));
            assert!(read(upper(-value)) >= -value - slack && read(lower(-value)) <= -value + slack);
            assert!(read(lower(value)) > 0.0, "{value} is no 0");
            value *= 1.618_033_988_75;
        }
        assert_eq!([upper(0.004_842_6), lower(0.138_36)], ["0.004843", "0.1383"]);
        assert_eq!([lower(6.530_6), lower(1e-7)], ["6.53", "1e-7"]);
    }

    /// Of an attempt, beta is a share with sixteen digits.
    #[test]
    fn confidences_are_short_and_go_down() {
        let said = [1e-3, 6.0 / (2.0 * std::f64::consts::PI).powi(2) * 1e-3, 1e-9].map(confidence);
        assert_eq!(said, ["1 - 0.001", "1 - 0.000152", "1 - 1e-9"]);
    }

    #[test]
    fn complements_are_exact() {
        let said = [0.1, 0.05, 0.9, 1e-9, 0.3].map(complement);
        assert_eq!(said, ["0.9", "0.95", "0.1", "0.999999999", "0.7"]);
        assert_eq!(complement(1e-16), "1 - 0.0000000000000001");
    }
}
