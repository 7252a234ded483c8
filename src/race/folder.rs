//! The races that are stored in the folder of an experiment.

use std::path::Path;

use super::controller::Name;
use super::log::{RaceLog, StoredRaces, arrays, damaged, is_sealed, races, sealed};
use crate::backend::Event;
use crate::error::{Error, Result};
use crate::files::{Staged, json, npz_bytes, read_npz};

/// Folder of the stored races.
pub(super) const RACES: &str = "races";

/// Name of the file of a batch of races.
pub(super) fn batch_file(name: Name, noise_seed: u64, first: usize) -> String {
    format!("{}-seed{noise_seed}-from{first}.npz", name.text())
}

/// Name of the file with what failed on the adapter until the races of `file` were done.
pub(super) fn events_of(file: &str) -> String {
    format!("{file}.events.json")
}

/// Stores races as `file`, `label` says which ones they are, and what failed on the adapter until
/// then.
pub(super) fn store(
    folder: &Path,
    file: &str,
    races: &[RaceLog],
    steps: u32,
    label: &str,
    events: &[Event],
) -> Result<()> {
    let mut staged = Staged::within(folder, RACES)?;
    // First: races that are there are not flown again.
    if !events.is_empty() {
        staged.add(&events_of(file), json(file, &events)?.as_bytes())?;
    }
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
    let StoredRaces { races: stored, most } =
        races(&arrays).map_err(|problem| damaged(path, &problem))?;
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
