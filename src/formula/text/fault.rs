//! What is wrong with a formula, and at which of its characters.

/// What people write, and what it is called here: found before the name that is nearest by its letters.
const MEANT: [(&str, &str); 24] = [
    ("norm", "hypot"),
    ("length", "hypot"),
    ("ln", "log"),
    ("arcsin", "asin"),
    ("arccos", "acos"),
    ("arctan", "atan"),
    ("arctan2", "atan2"),
    ("fabs", "abs"),
    ("sgn", "sign"),
    ("logistic", "sigmoid"),
    ("clip", "clamp"),
    ("saturate", "clamp"),
    ("where", "if"),
    ("wrap_angle", "wrap"),
    ("box", "bounds"),
    ("range", "bounds"),
    ("limits", "bounds"),
    ("bounds", "box"),
    ("range", "box"),
    ("limits", "box"),
    ("discount", "gamma"),
    ("steps", "horizon"),
    ("dt", "period"),
    ("method", "integrator"),
];

/// The first thing wrong with the text of a formula.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Where, in bytes from the beginning.
    pub at: usize,
    /// What was found there and what was expected.
    pub problem: String,
}

impl Fault {
    pub(super) fn new(at: usize, problem: impl Into<String>) -> Self {
        Self { at, problem: problem.into() }
    }

    /// The character of `text` that it is about, the first being 1.
    pub fn column(&self, text: &str) -> usize {
        1 + text.char_indices().take_while(|(at, _)| *at < self.at).count()
    }
}

/// The beginning of `text` that a message can carry: no line breaks, and not too much.
pub(crate) fn shown(text: &str) -> String {
    let most = 40;
    let mut short: String = text.chars().take(most).flat_map(char::escape_debug).collect();
    if text.chars().nth(most).is_some() {
        short.push_str("...");
    }
    short
}

/// Of `candidates` the one that is meant by `name`, whatever its letters.
#[cfg(feature = "cli")]
pub(crate) fn meant<'a>(
    name: &str,
    mut candidates: impl Iterator<Item = &'a str>,
) -> Option<&'a str> {
    candidates.find(|candidate| MEANT.contains(&(name, candidate)))
}

/// Of `candidates` the one that is meant by `name`, else the one that takes the fewest edits to get to.
pub(crate) fn nearest<'a>(
    name: &str,
    candidates: impl Iterator<Item = &'a str>,
) -> Option<&'a str> {
    let mut best: Option<&str> = None;
    let mut fewest = usize::MAX;
    // A name costs at least as many edits as its length differs: most are not looked at.
    for candidate in candidates {
        if MEANT.contains(&(name, candidate)) {
            return Some(candidate);
        }
        if candidate.len().abs_diff(name.len()) < fewest {
            let edits = strsim::damerau_levenshtein(name, candidate);
            if edits < fewest {
                (best, fewest) = (Some(candidate), edits);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn what_is_meant_goes_before_what_looks_alike() {
        let functions = ["exp", "hypot", "log", "atan2", "atan", "abs", "bounds"];
        let found = |name| nearest(name, functions.into_iter());
        assert_eq!(found("norm"), Some("hypot"));
        assert_eq!(found("ln"), Some("log"));
        assert_eq!(found("arctan2"), Some("atan2"));
        assert_eq!(nearest("box", ["unit", "bounds"].into_iter()), Some("bounds"));
        assert_eq!(nearest("range", ["unit", "box", "angle"].into_iter()), Some("box"));
        assert_eq!(nearest("discount", ["horizon", "gamma"].into_iter()), Some("gamma"));
        // Where what is meant is no candidate, letters count.
        assert_eq!(nearest("norm", ["form", "exp"].into_iter()), Some("form"));
        assert_eq!(found("hypto"), Some("hypot"));
    }
}
