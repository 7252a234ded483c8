//! The folder of a sweep: one file per finished point, and the tables of all of them.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::notes::notes;
use super::record::{PointRecord, PointResult, SweepRecord};
use super::table::table;
use crate::backend::Event;
use crate::digest;
use crate::error::{Error, Result};
use crate::files::{Claim, RECORD_BYTES, Staged, json, make_way, read_text};

/// The tables grow with the sweep: they are not written again sooner than this.
const TABLE_PERIOD: Duration = Duration::from_secs(1);
/// Folder of the points.
const POINTS: &str = "points";
/// Room for a point in its file, the tables, the record and the page, bytes.
const POINT_BYTES: u64 = 16 << 10;
/// Room for what does not grow with the points, bytes.
const PAGE_BYTES: u64 = 1 << 20;

/// A point as its file holds it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredPoint {
    /// SHA-256 over the point as JSON.
    content_sha256: String,
    point: PointRecord,
}

/// What a point came to.
#[derive(Clone, Debug)]
pub struct Computed {
    /// Its result.
    pub result: PointResult,
    /// What failed on the adapter until then.
    pub events: Vec<Event>,
}

/// A sweep whose points are stored as they come.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    /// All that is known of the sweep so far.
    record: SweepRecord,
    /// When the tables were written last.
    written: Option<Instant>,
    /// Given back where no point is done.
    claim: Claim,
}

impl Store {
    /// A sweep in `folder`, which belongs to the sweep of these axes that `identity` describes:
    /// everything that all points share. Values are no part of it, so that a grid can be extended.
    ///
    /// # Errors
    /// [`Error::File`] if the folder holds another experiment, [`Error::Write`] if it cannot be
    /// written to, [`Error::NoRoom`] if its disk is too full.
    pub fn open(folder: &Path, identity: &serde_json::Value, record: SweepRecord) -> Result<Self> {
        let need = record.total * POINT_BYTES + PAGE_BYTES;
        let claim = Claim::new(folder, &manifest(identity, &record), need)?;
        Staged::within(folder, POINTS)?;
        let folder = folder.to_owned();
        Ok(Self { folder, record, written: None, claim })
    }

    /// Removes the results of other work than this sweep from `folder`.
    ///
    /// # Errors
    /// [`Error::Write`] if they cannot be removed.
    pub fn make_way(
        folder: &Path,
        identity: &serde_json::Value,
        record: &SweepRecord,
    ) -> Result<()> {
        make_way(folder, &manifest(identity, record))
    }

    /// Adds the point with the values `values` and the hash `sha256`: the stored one, else what
    /// `compute` comes to, which is stored, and what failed on the adapter until then.
    ///
    /// # Errors
    /// [`Error::File`] for a stored point that is damaged; those of `compute`; [`Error::Write`].
    pub fn point(
        &mut self,
        sha256: String,
        values: Vec<String>,
        compute: impl FnOnce() -> Result<Computed>,
    ) -> Result<()> {
        let file = format!("{sha256}.json");
        let path = self.folder.join(POINTS).join(&file);
        let found = stored(&path, &sha256)?;
        let is_new = found.is_none();
        let Computed { result, events } = match found.map_or_else(compute, Ok) {
            Ok(done) => done,
            Err(error) if self.record.points.is_empty() => return Err(error),
            Err(error) => {
                self.tables()?;
                return Err(error);
            }
        };
        self.record.points.push(PointRecord { sha256, values, result, events });
        if !is_new {
            return Ok(());
        }
        let point = self.record.points.last().expect("one was added");
        let stored = StoredPoint { content_sha256: digest_of(point)?, point: point.clone() };
        let mut staged = Staged::within(&self.folder, POINTS)?;
        staged.add(&file, json(&file, &stored)?.as_bytes())?;
        staged.publish()?;
        match self.written.is_some_and(|written| written.elapsed() < TABLE_PERIOD) {
            true => Ok(()),
            false => self.tables().map(drop),
        }
    }

    /// Writes `sweep.csv` and `sweep.parquet` of the points so far.
    fn tables(&mut self) -> Result<Vec<PathBuf>> {
        self.written = Some(Instant::now());
        let table = table(&self.record);
        let mut staged = Staged::new(&self.folder)?;
        staged.add("sweep.parquet", &table.parquet()?)?;
        staged.add("sweep.csv", &table.csv()?)?;
        staged.publish()
    }

    /// Writes the tables, `sweep.json` and `page` of the record as `report.html`; the files.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn finish(&mut self, page: impl FnOnce(&SweepRecord) -> String) -> Result<Vec<PathBuf>> {
        self.claim.keep();
        self.record.notes = notes(&self.record);
        self.record.notes.extend(self.left_out());
        let mut files = self.tables()?;
        let mut staged = Staged::new(&self.folder)?;
        staged.add("report.html", page(&self.record).as_bytes())?;
        staged.add("sweep.json", json("sweep.json", &self.record)?.as_bytes())?;
        files.extend(staged.publish()?);
        Ok(files)
    }

    /// That the folder has points of values that are not asked for now.
    fn left_out(&self) -> Option<String> {
        let of_this = |name: &str| {
            self.record.points.iter().any(|point| name.strip_suffix(".json") == Some(&point.sha256))
        };
        let entries = std::fs::read_dir(self.folder.join(POINTS)).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        let count = names.filter(|name| name.ends_with(".json") && !of_this(name)).count();
        (count > 0).then(|| {
            format!(
                "stored points of values that were not asked for now: {count}; they are kept in \
                 `{POINTS}`, and the tables and the page are without them; ask for all values \
                 together to have them all"
            )
        })
    }

    /// The sweep so far.
    pub fn record(&self) -> &SweepRecord {
        &self.record
    }
}

/// What the folder of the sweep says that it holds.
fn manifest(identity: &serde_json::Value, record: &SweepRecord) -> String {
    let axes: Vec<&str> = record.axes.iter().map(|axis| axis.name.as_str()).collect();
    let manifest = serde_json::json!({ "axes": axes, "shared": identity });
    format!("{manifest:#}\n")
}

/// The result that the file at `path` holds; none where there is no file.
fn stored(path: &Path, sha256: &str) -> Result<Option<Computed>> {
    let damaged = |problem: &dyn std::fmt::Display| {
        let text = format!("{problem}; remove the file, and the point is computed again");
        Error::file(path, text)
    };
    let text = match read_text(path, RECORD_BYTES) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(damaged(&error)),
    };
    let StoredPoint { content_sha256, point } =
        serde_json::from_str(&text).map_err(|error| damaged(&error))?;
    if point.sha256 != sha256 {
        return Err(damaged(&"it is of another point"));
    }
    match digest_of(&point)? == content_sha256 {
        true => Ok(Some(Computed { result: point.result, events: point.events })),
        false => Err(damaged(&"it was edited after it was stored")),
    }
}

/// SHA-256 of a point.
fn digest_of(point: &PointRecord) -> Result<String> {
    Ok(digest::sha256([json("point", point)?.as_bytes()]))
}
