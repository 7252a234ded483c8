//! Where a description comes from: the file that errors name, with the line of a key.

use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use crate::error::Error;
use crate::formula::text::{Fault, shown};

/// Where a description was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// What errors call it: the file's name, or how else it was given.
    pub name: String,
    /// The folder that paths in it are relative to.
    pub folder: PathBuf,
    /// The text, where there is one: errors then name lines.
    pub text: Option<String>,
}

impl Origin {
    /// The origin `name`, with paths relative to `folder`.
    pub fn new(name: &str, folder: &Path) -> Self {
        Self { name: name.to_owned(), folder: folder.to_owned(), text: None }
    }

    /// The same with its text.
    #[must_use]
    pub fn with_text(mut self, text: &str) -> Self {
        self.text = Some(text.to_owned());
        self
    }

    /// The refusal of what stands at the dotted key `path`.
    pub(super) fn refuse(&self, path: &str, problem: impl Into<String>) -> Error {
        Error::invalid(format!("{}: {}", self.place(path), shown_path(path)), problem)
    }

    /// The refusal of the formula `text` at the dotted key `path`.
    pub(super) fn refuse_formula(&self, path: &str, text: &str, fault: &Fault) -> Error {
        let place = format!("{}: {}", self.place(path), shown_path(path));
        Error::invalid(format!("{place}, column {}", fault.column(text)), fault.problem.as_str())
    }

    /// The refusal of a text that is no TOML.
    pub(super) fn refuse_toml(&self, error: &toml::de::Error) -> Error {
        let message = error.message().trim_end().replace('\n', " ");
        let (Some(text), Some(span)) = (&self.text, error.span()) else {
            return Error::invalid(self.name.as_str(), message);
        };
        let line = line_of(text, span.start);
        let column = column_of(text, span.start);
        let found = text.get(span).filter(|found| !found.trim().is_empty());
        let found = found.map(|found| format!(", found `{}`", shown(found))).unwrap_or_default();
        let twice = if message.contains("duplicate key") { "two definitions: " } else { "" };
        let place = format!("{}:{line}:{column}", self.name);
        Error::invalid(place, format!("{twice}{message}{found}"))
    }

    /// The file and the line of the key `path`, or of what it is missing in.
    pub(crate) fn place(&self, path: &str) -> String {
        match self.text.as_deref().and_then(|text| line_of_key(text, path)) {
            Some(line) => format!("{}:{line}", self.name),
            None => self.name.clone(),
        }
    }
}

/// A dotted key that a message can carry.
fn shown_path(path: &str) -> String {
    path.split('.').map(shown).collect::<Vec<_>>().join(".")
}

/// The line of the key `path` in the TOML document `text`, or of the section it is missing in.
fn line_of_key(text: &str, path: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let mut table = document.get_ref();
    let mut line = None;
    for part in path.split('.') {
        // A formula of a list has its number behind the key.
        let list = part.split('[').next().unwrap_or(part);
        let same = |key: &str| key == part || key == list;
        let Some((key, value)) = table.iter().find(|(key, _)| same(key.get_ref())) else { break };
        line = Some(line_of(text, key.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    line
}

/// The line of byte `at`, the first being 1.
fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}

/// The character of byte `at` in its line, the first being 1.
fn column_of(text: &str, at: usize) -> usize {
    let before = text.get(..at).unwrap_or_default();
    1 + before.rsplit('\n').next().unwrap_or_default().chars().count()
}
