//! The entries of a zip archive, with the folder that they lie in.

use std::collections::HashMap;
use std::io::Cursor;

use crate::files::Archive;

/// Entries by their names.
#[derive(Debug)]
pub(super) struct Entries<'a> {
    archive: Archive<Cursor<&'a [u8]>>,
    names: Vec<String>,
    /// The number of the first entry of each name.
    numbers: HashMap<String, usize>,
    /// Where the entries lie, `archive/` in most checkpoints.
    folder: String,
}

impl<'a> Entries<'a> {
    /// The entries of the archive `bytes`.
    ///
    /// # Errors
    /// A sentence about damage.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let damaged = |e| format!("not a whole archive ({e})");
        let archive = Archive::open(Cursor::new(bytes), bytes.len() as u64).map_err(damaged)?;
        let names = archive.names().map_err(damaged)?;
        let numbers = names.iter().cloned().enumerate().rev().map(|(i, name)| (name, i)).collect();
        Ok(Self { archive, names, numbers, folder: String::new() })
    }

    /// The same with the folder that the entry `name` lies in, if there is one.
    pub(super) fn around(mut self, name: &str) -> Option<Self> {
        let folder = self.names.iter().find_map(|entry| entry.strip_suffix(name));
        let folder = folder.filter(|folder| folder.is_empty() || folder.ends_with('/'))?.to_owned();
        self.folder = folder;
        Some(self)
    }

    /// The names of all entries.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The names of the entries of the folder that begin with `start`, without the folder.
    pub(super) fn within(&self, start: &str) -> Vec<String> {
        let own = self.names.iter().filter_map(|entry| entry.strip_prefix(&self.folder));
        own.filter(|name| name.starts_with(start)).map(str::to_owned).collect()
    }

    /// Whether there is an entry `name`.
    pub(super) fn has(&self, name: &str) -> bool {
        self.index(name).is_some()
    }

    /// Content of the entry `name`.
    ///
    /// # Errors
    /// A sentence that names it, where it is missing, compressed or damaged.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>, String> {
        let index = self.index(name).ok_or_else(|| format!("no entry `{name}`"))?;
        self.archive.read(index).map_err(|problem| format!("entry `{name}`: {problem}"))
    }

    /// Content of the entry `name`, at most `most` bytes, which may be compressed.
    ///
    /// # Errors
    /// As [`Entries::read`].
    pub(super) fn inflated(&mut self, name: &str, most: usize) -> Result<Vec<u8>, String> {
        let index = self.index(name).ok_or_else(|| format!("no entry `{name}`"))?;
        self.archive.inflated(index, most).map_err(|problem| format!("entry `{name}`: {problem}"))
    }

    /// Number of the entry `name`.
    fn index(&self, name: &str) -> Option<usize> {
        self.numbers.get(&format!("{}{name}", self.folder)).copied()
    }
}
