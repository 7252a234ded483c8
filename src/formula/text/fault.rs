//! What is wrong with a formula, and at which of its characters.

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

/// Of `candidates` the one that takes the fewest edits to get to.
pub(crate) fn nearest<'a>(
    name: &str,
    candidates: impl Iterator<Item = &'a str>,
) -> Option<&'a str> {
    let mut best: Option<&str> = None;
    let mut fewest = usize::MAX;
    // A name costs at least as many edits as its length differs: most are not looked at.
    for candidate in candidates {
        if candidate.len().abs_diff(name.len()) < fewest {
            let edits = strsim::damerau_levenshtein(name, candidate);
            if edits < fewest {
                (best, fewest) = (Some(candidate), edits);
            }
        }
    }
    best
}
