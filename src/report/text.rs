//! Text for the page: escaping, counts and shares in words.

use std::fmt::Display;

pub(crate) use crate::rounding::{interval, lower, number, ordinary, upper};

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

/// `text` with a capital letter.
pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
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

/// The most that a share can be, in percent.
pub(crate) fn most_percent(share: f64) -> String {
    format!("{}\u{a0}%", upper(100.0 * share))
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

#[cfg(test)]
mod tests {
    use super::{count, escape, shorten, told_apart};

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
