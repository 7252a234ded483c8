//! Starts that come with their controls: what a certificate's failing pairs are replayed by.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, open, read_text};
use crate::model::Model;
use crate::rollout::RolloutSpec;
use crate::scenario::counterexamples::{is_replayed, read_replayed};

/// What is said of a rollout under listed controls.
pub(super) const NOTE: &str =
    "replayed in f64 on the host under the controls that the file lists, not under the policy";

/// Longest header that is looked at, bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// The measures of the starts in `path` under their own controls, where the file lists any.
///
/// # Errors
/// [`Error::File`] if it cannot be read, or is no such table of this model.
pub(super) fn measures(path: &Path, model: &Model, spec: &RolloutSpec) -> Result<Option<Vec<f32>>> {
    let csv = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    if !csv || !is_replayed(&header(path)?) {
        return Ok(None);
    }
    let text = read_text(path, RECORD_BYTES).map_err(|e| Error::file(path, e))?;
    let rows = read_replayed(&text, [&model.states, &model.controls], spec);
    let rows = rows.map_err(|e| Error::file(path, e))?;
    if rows.is_empty() {
        return Err(Error::file(path, "no state in it"));
    }
    // Rounding to f32 keeps the sign.
    Ok(Some(rows.iter().map(|row| row.measure(model, spec) as f32).collect()))
}

/// The first line of the file.
fn header(path: &Path) -> Result<String> {
    let file = open(path).map_err(|e| Error::file(path, e))?;
    let mut bytes = Vec::new();
    let read = BufReader::new(file.take(LONGEST_HEADER)).read_until(b'\n', &mut bytes);
    read.map_err(|e| Error::file(path, e))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
