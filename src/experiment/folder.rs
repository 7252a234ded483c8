//! The races that are stored in the folder of an experiment.

use std::path::Path;

use super::controller::Name;
use super::log::{RaceLog, arrays, damaged, is_sealed, races, sealed};
use crate::error::{Error, Result};
use crate::files::{Staged, npz_bytes, read_npz};

/// Folder of the stored races.
pub(super) const RACES: &str = "races";

/// Name of the file of a batch of races.
pub(super) fn batch_file(name: Name, noise_seed: u64, first: usize) -> String {
    format!("{}-seed{noise_seed}-from{first}.npz", name.text())
}

/// Stores races as `file`; `label` says which ones they are.
pub(super) fn store(
    folder: &Path,
    file: &str,
    races: &[RaceLog],
    steps: u32,
    label: &str,
) -> Result<()> {
    let mut staged = Staged::within(folder, RACES)?;
    staged.add(file, &npz_bytes(&sealed(arrays(races, steps as usize), label))?)?;
    staged.publish().map(drop)
}

/// The races that the file at `path` holds, if they are those from `starts` and of that length.
pub(super) fn stored(
    path: &Path,
    starts: &[[f32; 12]],
    steps: u32,
    label: &str,
) -> Result<Vec<RaceLog>> {
    let arrays = read_npz(path).map_err(|error| match error {
        Error::File { problem, .. } => damaged(path, &problem),
        other => other,
    })?;
    let (stored, most) = races(&arrays).map_err(|problem| damaged(path, &problem))?;
    if most != steps as usize {
        return Err(damaged(path, &format!("it holds races of {most} steps, not of {steps}")));
    }
    if !stored.iter().map(|race| &race.states[0]).eq(starts) {
        return Err(damaged(path, "its starts are others"));
    }
    match is_sealed(&arrays, label) {
        true => Ok(stored),
        false => {
            let problem = "edited, or of another controller, noise seed or experiment";
            Err(damaged(path, problem))
        }
    }
}
