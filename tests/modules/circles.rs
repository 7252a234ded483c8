//! Circles of imports among the files and folders of a folder.

use std::collections::{BTreeMap, BTreeSet};

use super::{Import, Place};

/// Parts of a folder that import each other, each by way of others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Circle {
    /// The folder, its names between slashes.
    pub(crate) folder: String,
    /// Its parts, in order; `mod` is the file of the folder itself.
    pub(crate) parts: Vec<String>,
    /// The imports among them, in words.
    pub(crate) imports: Vec<String>,
}

/// The circles of `folder`, whose parts `part` names.
pub(crate) fn circles(
    folder: &[String],
    imports: &[Import],
    part: impl Fn(&[String]) -> String,
) -> Vec<Circle> {
    let inside = |place: &Place| place.starts_with(folder);
    let inner = imports.iter().filter(|import| inside(&import.from) && inside(&import.to));
    let mut edges: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for Import { from, to, path } in inner {
        let ends = (part(&from[folder.len()..]), part(&to[folder.len()..]));
        if ends.0 != ends.1 {
            edges.entry(ends).or_default().push(format!("{}: {path}", from.join("/")));
        }
    }
    let reach = reach(edges.keys());
    let together = |a: &String, b: &String| reach[a].contains(b) && reach[b].contains(a);
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for one in reach.keys().filter(|one| reach[*one].contains(*one)) {
        if !seen.insert(one.clone()) {
            continue;
        }
        let parts: Vec<String> =
            reach.keys().filter(|other| *other == one || together(one, other)).cloned().collect();
        seen.extend(parts.iter().cloned());
        let among = edges.iter().filter(|((a, b), _)| parts.contains(a) && parts.contains(b));
        let imports = among.map(|((a, b), paths)| format!("{a} -> {b} ({})", paths[0])).collect();
        found.push(Circle { folder: folder.join("/"), parts, imports });
    }
    found
}

/// What each part gets to, over any number of edges.
fn reach<'a>(
    edges: impl Iterator<Item = &'a (String, String)>,
) -> BTreeMap<String, BTreeSet<String>> {
    let mut reach: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (from, to) in edges {
        reach.entry(from.clone()).or_default().insert(to.clone());
        reach.entry(to.clone()).or_default();
    }
    loop {
        let before: usize = reach.values().map(BTreeSet::len).sum();
        for part in reach.keys().cloned().collect::<Vec<_>>() {
            let next = reach[&part].iter().flat_map(|to| reach[to].clone()).collect::<Vec<_>>();
            reach.entry(part).or_default().extend(next);
        }
        if reach.values().map(BTreeSet::len).sum::<usize>() == before {
            return reach;
        }
    }
}
