//! States from .npy and .csv files, read in pieces, so that memory does not grow with the file.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::Format;
use super::elements::Elements;
use super::lines::Lines;
use super::list::StateList;
use crate::error::{Error, Result};

/// States one after the other, as many finite numbers each as there are names.
///
/// A .npy file holds f32 or f64, little-endian, of shape `[N, states]`, row by row or column by
/// column. A .csv file holds a state per line, its numbers separated by commas, semicolons, tabs or
/// blanks; a header, plain or after `#`, names the states in any order.
#[derive(Debug)]
pub struct StateReader {
    path: PathBuf,
    rows: Rows,
    names: Vec<String>,
    read: u64,
}

/// Where rows come from.
#[derive(Debug)]
enum Rows {
    Npy(Elements),
    Csv(Lines),
}

impl StateReader {
    /// Opens `path`, .npy or .csv; `names` are those of the states.
    ///
    /// # Errors
    /// [`Error::File`] if it is missing, or its type or shape is not that of states.
    pub fn open(path: &Path, names: Vec<String>) -> Result<Self> {
        let format = Format::of(path)?;
        let file = super::open(path).map_err(|e| Error::file(path, e))?;
        let file = BufReader::new(file);
        let rows = match format {
            Format::Csv => Rows::Csv(Lines::new(file)),
            Format::Npy => Rows::Npy(
                Elements::open(file, names.len()).map_err(|problem| Error::file(path, problem))?,
            ),
        };
        Ok(Self { path: path.to_owned(), rows, names, read: 0 })
    }

    /// Number of states left, where the file says so beforehand.
    pub fn left(&self) -> Option<u64> {
        match &self.rows {
            Rows::Npy(elements) => Some(elements.left()),
            Rows::Csv(_) => None,
        }
    }

    /// The next states, at most `most`; none at the end of the file.
    ///
    /// # Errors
    /// [`Error::File`] naming the row that is damaged, of the wrong width, or not finite.
    pub fn next(&mut self, most: usize) -> Result<StateList> {
        let mut states = StateList::new(self.names.len());
        while states.len() < most {
            let mut state = vec![0.0; self.names.len()];
            let found = match &mut self.rows {
                Rows::Npy(elements) => elements.next(&mut state),
                Rows::Csv(lines) => lines.next(&mut state, &self.names),
            };
            let at = |problem| Error::file(&self.path, problem);
            if !found.map_err(at)? {
                break;
            }
            if let Some(i) = state.iter().position(|value: &f32| !value.is_finite()) {
                let (name, row) = (&self.names[i], self.read);
                return Err(at(format!("state {row} (from 0): {name} is not a finite f32")));
            }
            states.push(&state);
            self.read += 1;
        }
        if self.read == 0 {
            return Err(Error::file(&self.path, "no state in it"));
        }
        Ok(states)
    }

    /// All states that are left.
    ///
    /// # Errors
    /// As [`StateReader::next`].
    pub fn rest(mut self) -> Result<StateList> {
        self.next(usize::MAX)
    }
}
