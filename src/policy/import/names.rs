//! Names of tensors: their keys, and their order.

use std::cmp::Ordering;

/// Keys that a last layer goes by.
const HEADS: [&str; 13] = [
    "mu",
    "mean",
    "fc_mu",
    "fc_mean",
    "fc_out",
    "out",
    "output",
    "output_layer",
    "action",
    "action_net",
    "head",
    "last",
    "final",
];

/// Whether `name` lies under `prefix`.
pub(super) fn starts_with(name: &str, prefix: &str) -> bool {
    let rest = name.strip_prefix(prefix);
    prefix.is_empty() || rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Whether some keys of `name`, one after the other, are those of `keys`.
pub(super) fn holds(name: &str, keys: &str) -> bool {
    format!(".{name}.").contains(&format!(".{keys}."))
}

/// What stands in `name` before `keys` and after them, both without dots at their ends.
pub(super) fn around<'a>(name: &'a str, keys: &str) -> Option<(&'a str, &'a str)> {
    let found = name.match_indices(keys).find_map(|(at, _)| {
        let (before, rest) = (&name[..at], &name[at + keys.len()..]);
        let begins = before.is_empty() || before.ends_with('.');
        (begins && (rest.is_empty() || rest.starts_with('.'))).then_some((before, rest))
    });
    found.map(|(before, rest)| (before.trim_end_matches('.'), rest.trim_start_matches('.')))
}

/// `name` under `outer`.
pub(super) fn under(outer: &str, name: &str) -> String {
    if outer.is_empty() { name.to_owned() } else { format!("{outer}.{name}") }
}

/// The module of `name`, and its last key.
pub(super) fn split(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// The order of two names in a file without one: numbers as numbers, last layers last.
pub(super) fn compare(a: &str, b: &str) -> Ordering {
    let head = is_head;
    let module = split(a).0.cmp(split(b).0);
    let heads = if module == Ordering::Equal { head(a).cmp(&head(b)) } else { Ordering::Equal };
    heads.then_with(|| parts(a).cmp(&parts(b)))
}

/// Whether the last key of a layer is one that a last layer goes by.
pub(super) fn is_head(name: &str) -> bool {
    HEADS.contains(&split(name).1)
}

/// A run of digits as its number, or of other characters.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part<'a> {
    /// Longer is larger, without leading zeros.
    Number(usize, &'a str),
    Text(&'a str),
}

/// The runs of digits and of other characters in `name`.
fn parts(name: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digits = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(rest.len());
        let (run, after) = rest.split_at(end);
        let number = run.trim_start_matches('0');
        parts.push(if digits { Part::Number(number.len(), number) } else { Part::Text(run) });
        rest = after;
    }
    parts
}

/// What a name has before the number that it ends in, and the number.
pub(super) fn numbered(name: &str) -> Option<(&str, u64)> {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    Some((stem, name[stem.len()..].parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_sorted_as_numbers_and_heads_come_last() {
        let mut names = ["a.mu", "a.fc10", "a.fc2", "a.fc1", "a.fc_mean"];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["a.fc1", "a.fc2", "a.fc10", "a.fc_mean", "a.mu"]);
        let mut names = ["p.Dense_10.kernel", "p.Dense_9.kernel", "p.Dense_09.bias"];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["p.Dense_09.bias", "p.Dense_9.kernel", "p.Dense_10.kernel"]);
        assert_eq!(numbered("fc12"), Some(("fc", 12)));
        assert_eq!(numbered("mu"), None);
    }

    #[test]
    fn keys_are_found_as_a_whole() {
        assert_eq!(around("agent.ac.actor.pi.0", "actor.pi"), Some(("agent.ac", "0")));
        assert_eq!(around("actor_old.pi.0", "actor"), None);
        assert_eq!(around("a.mu.mu", "mu"), Some(("a", "mu")));
        assert!(holds("a.b.c", "b") && !holds("a.bc", "b"));
    }
}
