//! The verdict on the box in a sentence: the certified subset beside the whole, so that a box that mostly
//! fails never reads as certified.

use super::record::GlobalRecord;

/// Decimals of a risk in a sentence.
const RISK_DECIMALS: i32 = 6;
/// Decimals of a share in percent.
const SHARE_DECIMALS: i32 = 3;

/// What is certified of the box, and how often any start of it fails.
pub(super) fn verdict(global: &GlobalRecord, [low, high]: [f64; 2]) -> String {
    let whole = format!(
        "over the whole box a start fails with probability {} to {}",
        risk_below(low),
        risk_above(high)
    );
    let mostly = match () {
        () if low > 0.5 => ": most of the box fails",
        () if high >= 0.5 => ": it is not shown that most of the box succeeds",
        () => "",
    };
    format!("{}; {whole}{mostly}", subset(global))
}

/// What is certified of the box.
fn subset(global: &GlobalRecord) -> String {
    if global.accepted == 0 {
        return "nothing of the box is certified".to_owned();
    }
    let [low, high] = global.share_interval.map(|share| 100.0 * share);
    format!(
        "certified is {} to {} % of the box, where a perturbed start fails with probability at most {}",
        below(low, SHARE_DECIMALS),
        above(high, SHARE_DECIMALS),
        risk_above(global.claim.certified_risk)
    )
}

/// A probability, never below `value`.
pub(super) fn risk_above(value: f64) -> String {
    above(value, RISK_DECIMALS)
}

/// A probability, never above `value`.
pub(super) fn risk_below(value: f64) -> String {
    below(value, RISK_DECIMALS)
}

/// The least number with so many decimals that is not below `value`.
fn above(value: f64, decimals: i32) -> String {
    let scale = 10.0_f64.powi(decimals);
    let text = |count: f64| format!("{:.*}", decimals as usize, count / scale);
    let count = (value * scale).ceil();
    // What is read from the text counts, whichever way the product was rounded.
    let low = text(count);
    if low.parse::<f64>().is_ok_and(|read| read < value) { text(count + 1.0) } else { low }
}

/// The greatest number with so many decimals that is not above `value`.
fn below(value: f64, decimals: i32) -> String {
    let scale = 10.0_f64.powi(decimals);
    let text = |count: f64| format!("{:.*}", decimals as usize, count / scale);
    let count = (value * scale).floor();
    let high = text(count);
    if high.parse::<f64>().is_ok_and(|read| read > value) { text(count - 1.0) } else { high }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_rounded_outward() {
        for value in [0.1, 0.300_000_1, 1e-9, 0.999_999_9, 0.004_842_6, 1.0, 0.0, 65.306_1] {
            for decimals in [3, 6] {
                let [low, high] = [below(value, decimals), above(value, decimals)];
                let read = |text: &str| text.parse::<f64>().unwrap();
                assert!(read(&low) <= value && value <= read(&high), "{low} {value} {high}");
                assert!(
                    read(&high) - read(&low) <= 1.01 * 10.0_f64.powi(-decimals),
                    "{low} {high}"
                );
            }
        }
        assert_eq!([risk_above(0.004_842_61), risk_below(0.004_842_61)], ["0.004843", "0.004842"]);
    }
}
