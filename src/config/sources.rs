//! Where the values of a configuration were written, for faults that show once they are used.

use toml::Table;

use crate::error::Error;
use crate::model::text::Origin;

/// A document with the name that errors have for it.
pub(super) type Layer = (String, Table);

/// What errors about a described plant call the configuration where its text is not at hand.
pub(super) const UNNAMED: &str = "configuration";
/// Sections and keys that a configuration begins with.
const SECTIONS: [&str; 21] = [
    "profile",
    "seed",
    "attempt",
    "system",
    "model",
    "policy",
    "rollout",
    "box",
    "constants",
    "deviation",
    "global",
    "drops",
    "calibration",
    "deterministic",
    "slice",
    "state",
    "growth",
    "sequential",
    "race",
    "train",
    "plan",
];

/// The file and the settings over it; neither for a configuration that was stored.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    /// The file, with its text where there is one.
    pub(super) file: Option<Origin>,
    /// The keys of the file.
    pub(super) given: Table,
    /// What is set over it, in order.
    pub(super) sets: Vec<Layer>,
}

impl PartialEq for Sources {
    /// A configuration asks for the same wherever it was written.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Sources {
    /// Whether the file or a setting has the dotted key `path`.
    pub(super) fn give(&self, path: &str) -> bool {
        has(&self.given, path) || self.sets.iter().any(|(_, set)| has(set, path))
    }

    /// The first key of the file that is `path` or in that section, `but` one.
    pub(super) fn given_within(&self, path: &str, but: &str) -> Option<String> {
        within(&self.given, path, but)
    }

    /// The first such key among the settings over the file.
    pub(super) fn set_within(&self, path: &str, but: &str) -> Option<String> {
        self.sets.iter().find_map(|(_, set)| within(set, path, but))
    }

    /// `error` with the setting or the line of the file that its key comes from.
    pub(super) fn placed(&self, error: Error) -> Error {
        let Error::Invalid { place, problem } = error else { return error };
        let inner = place.strip_prefix(UNNAMED).and_then(|rest| rest.strip_prefix(": "));
        let inner = inner.unwrap_or(&place);
        let path = inner.split([',', '[']).next().unwrap_or_default();
        let (Some(file), true) = (&self.file, is_key(path)) else {
            return Error::Invalid { place, problem };
        };
        let place = match self.sets.iter().rev().find(|(_, set)| has(set, path)) {
            // The whole option says what it sets; of a list, which part is meant.
            Some((name, _)) if inner == path && name.contains(&format!(" {path}=")) => name.clone(),
            Some((name, _)) => format!("{name}: {inner}"),
            None => format!("{}: {inner}", file.place(path)),
        };
        Error::Invalid { place, problem }
    }
}

/// Whether `path` begins as the keys of a configuration do.
fn is_key(path: &str) -> bool {
    SECTIONS.contains(&path.split('.').next().unwrap_or_default())
}

/// Whether `table` has the dotted key `path`.
fn has(table: &Table, path: &str) -> bool {
    let (first, rest) =
        path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    match (table.get(first), rest) {
        (None, _) => false,
        (Some(_), None) => true,
        (Some(value), Some(rest)) => value.as_table().is_some_and(|inner| has(inner, rest)),
    }
}

/// The first key of `table` that is the dotted `path`, or in the section of this name, `but` one.
fn within(table: &Table, path: &str, but: &str) -> Option<String> {
    let (first, rest) =
        path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    let section = table.get(first)?.as_table()?;
    let keys = section.keys().filter(|key| rest.is_none_or(|rest| rest == key.as_str()));
    keys.map(|key| format!("{first}.{key}")).find(|key| key != but)
}
