//! Text for the page: escaping, and numbers with the rounding that keeps a claim true.

use std::fmt::Display;

/// Beyond this a number stands for "not finite": `rollout::HUGE`, also discounted or scaled.
const ORDINARY: f64 = 1.0e20;
/// Significant digits after the first.
const DIGITS: usize = 3;

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

/// `text` with the characters that mean something to HTML replaced.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Control characters are not allowed in HTML, not even as references.
            _ if character.is_control() && !character.is_whitespace() => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

/// The first characters of `text`, with an ellipsis where some were cut: for labels of figures.
pub(crate) fn shorten(text: &str, limit: usize) -> String {
    if text.chars().count() <= limit {
        return text.to_owned();
    }
    let start: String = text.chars().take(limit.saturating_sub(1)).collect();
    format!("{start}…")
}

/// Each of `texts` in at most `limit` characters, different texts told apart: what all of them begin
/// with is left out where their beginnings would look the same, and the place is added where that
/// is not enough.
pub(crate) fn told_apart(texts: &[&str], limit: usize) -> Vec<String> {
    let cut = |skipped: usize| -> Vec<String> {
        let one = |text: &&str| match skipped {
            0 => shorten(text, limit),
            _ => shorten(&format!("…{}", text.chars().skip(skipped).collect::<String>()), limit),
        };
        texts.iter().map(one).collect()
    };
    let differ = |cut: &[String]| {
        let mut seen: Vec<(&str, &String)> = texts.iter().copied().zip(cut).collect();
        seen.sort_by_key(|(_, short)| *short);
        seen.windows(2).all(|pair| pair[0].1 != pair[1].1 || pair[0].0 == pair[1].0)
    };
    let plain = cut(0);
    if differ(&plain) {
        return plain;
    }
    let without = cut(common_beginning(texts));
    if differ(&without) {
        return without;
    }
    let numbered = |(at, text): (usize, &&str)| {
        let number = format!("#{} ", at + 1);
        let left = limit.saturating_sub(number.len()).max(1);
        number + &shorten(text, left)
    };
    texts.iter().enumerate().map(numbered).collect()
}

/// Characters that all of `texts` begin with.
fn common_beginning(texts: &[&str]) -> usize {
    let Some((first, rest)) = texts.split_first() else { return 0 };
    let shared =
        |other: &&str| first.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    rest.iter().map(shared).min().unwrap_or(0)
}

/// Four significant digits, to the nearest.
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

/// A count with a comma after every third digit.
pub(crate) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// `value` if there is one, else a dash.
pub(crate) fn or_dash(value: Option<impl Display>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| value.to_string())
}

/// A share in percent; the sign stays on the line of its number.
pub(crate) fn percent(share: f64) -> String {
    format!("{}\u{a0}%", number(100.0 * share))
}

/// An interval of shares in percent, rounded outwards.
pub(crate) fn percents(shares: [f64; 2]) -> String {
    format!("{}\u{a0}%", interval(shares.map(|share| 100.0 * share)))
}

/// A number with true minus signs, after which no line breaks.
pub(crate) fn minus(number: &str) -> String {
    number.replace('-', "−")
}

/// `noun` after its count, `nouns` unless there is one.
pub(crate) fn counted(count: usize, noun: &str, nouns: &str) -> String {
    format!("{count} {}", if count == 1 { noun } else { nouns })
}

/// `a`, `a and b`, or `a, b and c`.
pub(crate) fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

fn rounded(value: f64, rounding: Rounding) -> String {
    if !ordinary(value) {
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

#[cfg(test)]
mod tests {
    use super::{count, escape, interval, lower, number, shorten, told_apart, upper};

    #[test]
    fn cut_texts_are_told_apart() {
        assert_eq!(told_apart(&["one", "two"], 18), ["one", "two"]);
        let files = ["policies/race_policy.safetensors", "policies/race_policy_box.safetensors"];
        assert_eq!(
            told_apart(&files, 12),
            ["….safetensors", "…_box.safet…"].map(|t| shorten(t, 12))
        );
        // Neither the beginning nor the rest tells these apart.
        let long: Vec<String> =
            (0..500).map(|i| format!("{}{i}", "x".repeat(40 + i % 7))).collect();
        let long: Vec<&str> = long.iter().map(String::as_str).collect();
        let mut short = told_apart(&long, 12);
        assert!(short.iter().all(|text| text.chars().count() <= 12), "{short:?}");
        short.sort();
        short.dedup();
        assert_eq!(short.len(), 500);
    }

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

    #[test]
    fn counts_are_grouped() {
        assert_eq!(count(7), "7");
        assert_eq!(count(158), "158");
        assert_eq!(count(1_000), "1,000");
        assert_eq!(count(u64::MAX), "18,446,744,073,709,551,615");
    }

    #[test]
    fn markup_becomes_text() {
        assert_eq!(escape("<a b='c'>&\"\u{1}"), "&lt;a b=&#39;c&#39;&gt;&amp;&quot;\u{fffd}");
        assert_eq!(shorten("position", 5), "posi…");
        assert_eq!(shorten("ego_x", 5), "ego_x");
    }
}
