//! States from .npy and .csv files, read in pieces, so that memory does not grow with the file.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::Format;
use super::array::NpyHeader;
use crate::error::{Error, Result};
use crate::rollout::StateList;

/// Longest line of a .csv file, bytes.
const LONGEST_LINE: u64 = 65_536;

/// States one after the other, as many finite numbers each as there are names.
///
/// A .npy file holds f32 or f64, little-endian, of shape `[N, states]`. A .csv file holds a state per
/// line; a header, plain or after `#`, has to name the states in order.
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
    /// Elements of `bytes` bytes; `left` rows of them.
    Npy { file: BufReader<File>, bytes: usize, left: u64 },
    /// Lines; `number` have been read.
    Csv { file: BufReader<File>, number: u64 },
}

impl StateReader {
    /// Opens `path`, .npy or .csv; `names` are those of the states.
    ///
    /// # Errors
    /// [`Error::File`] if it is missing, or its type or shape is not that of states.
    pub fn open(path: &Path, names: Vec<String>) -> Result<Self> {
        let format = Format::of(path)?;
        let file = File::open(path).map_err(|e| Error::file(path, e))?;
        let size = file.metadata().map_err(|e| Error::file(path, e))?.len();
        let mut file = BufReader::new(file);
        let rows = match format {
            Format::Csv => Rows::Csv { file, number: 0 },
            Format::Npy => {
                let (bytes, left) = NpyHeader::read(&mut file)
                    .and_then(|header| check(&header, names.len(), size))
                    .map_err(|problem| Error::file(path, problem))?;
                Rows::Npy { file, bytes, left }
            }
        };
        Ok(Self { path: path.to_owned(), rows, names, read: 0 })
    }

    /// Number of states left, where the file says so beforehand.
    pub fn left(&self) -> Option<u64> {
        match self.rows {
            Rows::Npy { left, .. } => Some(left),
            Rows::Csv { .. } => None,
        }
    }

    /// The next states, at most `most`; none at the end of the file.
    ///
    /// # Errors
    /// [`Error::File`] naming the row that is damaged, of the wrong width, or not finite.
    pub fn next(&mut self, most: usize) -> Result<StateList> {
        let mut states = StateList::new(self.names.len());
        while states.len() < most {
            let row = match &mut self.rows {
                Rows::Npy { file, bytes, left } => npy_row(file, self.names.len(), *bytes, left),
                Rows::Csv { file, number } => csv_row(file, number, &self.names),
            };
            let at = |problem| Error::file(&self.path, problem);
            let Some(state) = row.map_err(at)? else { break };
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

/// Bytes of an element and number of rows of an array of states in a file of `size` bytes.
fn check(
    header: &NpyHeader,
    states: usize,
    size: u64,
) -> std::result::Result<(usize, u64), String> {
    let NpyHeader { descr, shape, .. } = header;
    let bytes = match descr.as_str() {
        "<f4" => 4,
        "<f8" => 8,
        other => return Err(format!("dtype {other}, expected <f4 or <f8 (f32 or f64)")),
    };
    let &[rows, columns] = shape.as_slice() else {
        return Err(format!("shape {shape:?}, expected [N, {states}]"));
    };
    if columns != states as u64 {
        return Err(format!(
            "shape {shape:?}, expected [N, {states}]: a state has {states} numbers"
        ));
    }
    if header.fortran_order {
        return Err("stored column by column; save it in C order".to_owned());
    }
    let need = rows.checked_mul((states * bytes) as u64);
    if need.is_none_or(|need| need > size) {
        return Err(format!("truncated: {rows} states announced, the file has {size} bytes"));
    }
    Ok((bytes, rows))
}

/// The next row of an array.
fn npy_row(
    file: &mut BufReader<File>,
    states: usize,
    bytes: usize,
    left: &mut u64,
) -> std::result::Result<Option<Vec<f32>>, String> {
    if *left == 0 {
        return Ok(None);
    }
    *left -= 1;
    let mut state = vec![0.0; states];
    for value in &mut state {
        let mut buffer = [0; 8];
        let element = &mut buffer[..bytes];
        file.read_exact(element).map_err(|e| format!("truncated ({e})"))?;
        *value = match bytes {
            4 => f32::from_le_bytes([buffer[0], buffer[1], buffer[2], buffer[3]]),
            _ => f64::from_le_bytes(buffer) as f32,
        };
    }
    Ok(Some(state))
}

/// The state of the next line that has one; a header is checked against `names`.
fn csv_row(
    file: &mut BufReader<File>,
    number: &mut u64,
    names: &[String],
) -> std::result::Result<Option<Vec<f32>>, String> {
    loop {
        let mut line = String::new();
        let limited = &mut file.by_ref().take(LONGEST_LINE);
        let length = limited.read_line(&mut line).map_err(|e| e.to_string())?;
        if length == 0 {
            return Ok(None);
        }
        *number += 1;
        if length as u64 == LONGEST_LINE {
            return Err(format!("line {number} is longer than {LONGEST_LINE} bytes"));
        }
        let text = line.trim().trim_start_matches('\u{feff}');
        let header = text.strip_prefix('#');
        let fields: Vec<&str> = header.unwrap_or(text).split(',').map(str::trim).collect();
        let plain = *number == 1 && fields[0].parse::<f64>().is_err();
        match header {
            _ if text.is_empty() => {}
            // A comment has no commas; a header of one state cannot be told from it.
            Some(_) if fields.len() == 1 => {}
            Some(_) => check_names(&fields, names)?,
            None if plain => check_names(&fields, names)?,
            None => return parse_row(&fields, names.len(), *number).map(Some),
        }
    }
}

/// Refuses a header that does not name the states in order.
fn check_names(fields: &[&str], names: &[String]) -> std::result::Result<(), String> {
    if fields.iter().eq(names) {
        return Ok(());
    }
    let (found, expected) = (fields.join(","), names.join(","));
    Err(format!("header `{found}`, expected the states `{expected}`"))
}

/// The numbers of a line.
fn parse_row(fields: &[&str], states: usize, number: u64) -> std::result::Result<Vec<f32>, String> {
    if fields.len() != states {
        let found = fields.len();
        return Err(format!("line {number} has {found} numbers, a state has {states}"));
    }
    let mut state = vec![0.0; states];
    for (value, field) in state.iter_mut().zip(fields) {
        // Through f64, as for arrays: one rounding to f32 from the number as written.
        let parsed = field.parse::<f64>();
        *value = parsed.map_err(|_| format!("line {number}: `{field}` is not a number"))? as f32;
    }
    Ok(state)
}
