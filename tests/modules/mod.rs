//! The modules of a crate, and which of them each imports, as its texts say it.
//!
//! Code of tests is left out. A path is followed to the file that defines what it names: through
//! `super`, lists, names that a file has imported, and what a `mod.rs` hands on of its own folder,
//! which is no import of that file.

pub(crate) mod circles;
mod words;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use words::{Mention, mentions, words};

/// The names that lead to a module from the root of the crate.
pub(crate) type Place = Vec<String>;

/// A file of the crate.
#[derive(Debug)]
struct Module {
    /// Names that it imports, and the paths that they stand for.
    names: BTreeMap<String, Vec<String>>,
    mentions: Vec<Mention>,
}

/// One file names something that another one defines.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Import {
    /// Who names it.
    pub(crate) from: Place,
    /// Who defines it.
    pub(crate) to: Place,
    /// The path as written.
    pub(crate) path: String,
}

/// All files of a crate.
#[derive(Debug)]
pub(crate) struct Modules(BTreeMap<Place, Module>);

impl Modules {
    /// Those of the files in `folder`, `main.rs` aside.
    pub(crate) fn read(folder: &Path) -> Self {
        Self::of(texts(folder))
    }

    /// Those of files given by name and text.
    pub(crate) fn of(files: impl IntoIterator<Item = (String, String)>) -> Self {
        let known = |(name, text): (String, String)| {
            let place = place(&name)?;
            let mentions = mentions(&words(&name, &text));
            let named = mentions.iter().filter(|mention| mention.name.is_some());
            let names = named
                .map(|mention| (mention.name.clone().unwrap_or_default(), mention.path.clone()));
            Some((place, Module { names: names.collect(), mentions }))
        };
        Self(files.into_iter().filter_map(known).collect())
    }

    /// The places of the folders, the root first.
    pub(crate) fn folders(&self) -> Vec<Place> {
        let mut folders: Vec<Place> = Vec::new();
        for place in self.0.keys() {
            folders.extend((0..place.len()).map(|length| place[..length].to_vec()));
        }
        folders.sort();
        folders.dedup();
        folders
    }

    /// Every import of one file from another, each pair of files by each path once.
    pub(crate) fn imports(&self) -> Vec<Import> {
        let mut imports = Vec::new();
        for (from, module) in &self.0 {
            for mention in &module.mentions {
                let Some(to) = self.defined(from, &mention.path) else { continue };
                let own = to.starts_with(from);
                // A file that hands on what is in its own folder does not use it.
                if to != *from && !(own && mention.handed_on) {
                    imports.push(Import { from: from.clone(), to, path: mention.path.join("::") });
                }
            }
        }
        imports.sort();
        imports.dedup();
        imports
    }

    /// The file that defines what `path` names in `from`; none for another crate's.
    fn defined(&self, from: &[String], path: &[String]) -> Option<Place> {
        let (base, rest) = self.base(from, path, 0)?;
        self.follow(base, &rest, 0)
    }

    /// Where `path` begins, and what is left of it.
    fn base(&self, from: &[String], path: &[String], depth: usize) -> Option<(Place, Vec<String>)> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => Some((Vec::new(), rest.to_vec())),
            "self" => Some((from.to_vec(), rest.to_vec())),
            "super" => {
                let ups = path.iter().take_while(|word| *word == "super").count();
                let base = from[..from.len().checked_sub(ups)?].to_vec();
                Some((base, path[ups..].to_vec()))
            }
            _ if self.0.contains_key(&child(from, first)) => Some((from.to_vec(), path.to_vec())),
            _ => {
                let meant = self.0.get(from)?.names.get(first)?;
                let other = meant.first() != Some(first) && depth < DEPTH;
                other.then(|| self.base(from, &[meant, rest].concat(), depth + 1))?
            }
        }
    }

    /// The file that `path` from `base` ends in.
    fn follow(&self, mut base: Place, path: &[String], depth: usize) -> Option<Place> {
        for (at, word) in path.iter().enumerate() {
            let inner = child(&base, word);
            if self.0.contains_key(&inner) {
                base = inner;
            } else if let Some(meant) = self.0.get(&base)?.names.get(word) {
                let path = [meant, &path[at + 1..]].concat();
                let (base, rest) = self.base(&base, &path, 0)?;
                return if depth < DEPTH { self.follow(base, &rest, depth + 1) } else { None };
            } else {
                break;
            }
        }
        Some(base)
    }
}

/// Names that stand for names that stand for names end somewhere.
const DEPTH: usize = 16;

/// `place` and one name more.
fn child(place: &[String], name: &str) -> Place {
    place.iter().cloned().chain([name.to_owned()]).collect()
}

/// The module of a file; none for those of tests, and for the program.
fn place(file: &str) -> Option<Place> {
    let mut names: Place = file.strip_suffix(".rs")?.split('/').map(str::to_owned).collect();
    if names.iter().any(|name| name == "tests") || names == ["main"] {
        return None;
    }
    if names == ["lib"] || names.last().is_some_and(|name| name == "mod") {
        names.pop();
    }
    Some(names)
}

/// The files of Rust below `folder`, by their names within it, and their texts.
pub(crate) fn texts(folder: &Path) -> Vec<(String, String)> {
    let mut files = Vec::new();
    rust_files(folder, &mut files);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a source file");
        let name = path.strip_prefix(folder).expect("a file of the folder");
        (name.to_string_lossy().replace('\\', "/"), text)
    };
    files.into_iter().map(read).collect()
}

/// All files of Rust below `folder`.
fn rust_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source folder") {
        let path = entry.expect("an entry of the source folder").path();
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            out.push(path);
        }
    }
}
