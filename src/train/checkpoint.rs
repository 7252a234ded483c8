//! Where a run of training stands, in one file that is written whole or not at all.

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use super::record::CurvePoint;
use crate::error::{Error, Result};
use crate::files::{ARCHIVE_BYTES, Staged, json, read};

/// Name of the file.
const FILE: &str = "checkpoint.safetensors";
/// Its metadata entry with the progress as JSON.
const PROGRESS: &str = "progress";
/// What stands before the names of the best networks so far.
const BEST: &str = "best.";

/// How far a run has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunProgress {
    /// Iterations done.
    pub iteration: u64,
    /// Whether it ended early.
    pub stopped_early: bool,
    /// Iterations done at the best score.
    pub best: u64,
    /// Sum of the losses since the last score.
    #[serde(with = "crate::files::number")]
    pub loss: f64,
    /// The scores so far.
    pub curve: Vec<CurvePoint>,
}

/// A stored run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// How far it has come.
    pub progress: RunProgress,
    /// Files of the best networks, by name.
    pub best: Vec<(String, Vec<u8>)>,
    /// What the learner goes on with, by name.
    pub arrays: Vec<(String, Vec<f32>)>,
}

impl Checkpoint {
    /// Writes the checkpoint to `folder`.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's reason.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let bytes = self.to_bytes()?;
        let mut staged = Staged::new(folder)?;
        staged.add(FILE, &bytes)?;
        staged.publish().map(|_| ())
    }

    /// The bytes of the file.
    fn to_bytes(&self) -> Result<Vec<u8>> {
        let damaged = |e: safetensors::SafeTensorError| Error::invalid(FILE, e.to_string());
        let mut views = Vec::new();
        for (name, bytes) in &self.best {
            let view = TensorView::new(Dtype::U8, vec![bytes.len()], bytes).map_err(damaged)?;
            views.push((format!("{BEST}{name}"), view));
        }
        for (name, values) in &self.arrays {
            let bytes = bytemuck::cast_slice(values);
            let view = TensorView::new(Dtype::F32, vec![values.len()], bytes).map_err(damaged)?;
            views.push((name.clone(), view));
        }
        let progress = HashMap::from([(PROGRESS.to_owned(), json(FILE, &self.progress)?)]);
        safetensors::serialize(views, Some(progress)).map_err(damaged)
    }

    /// The checkpoint in `folder`; none if there is no file.
    ///
    /// # Errors
    /// [`Error::File`] if it is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(FILE);
        let bytes = match read(&path, ARCHIVE_BYTES) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::file(&path, error)),
        };
        let damaged = |problem: String| {
            Error::file(&path, format!("damaged ({problem}); remove it to begin again"))
        };
        Self::from_bytes(&bytes).map(Some).map_err(damaged)
    }

    fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, String> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
        let metadata = header.metadata().as_ref();
        let progress = metadata.and_then(|entries| entries.get(PROGRESS)).ok_or("no progress")?;
        let progress = serde_json::from_str(progress).map_err(|e| e.to_string())?;
        let mut checkpoint = Self { progress, ..Self::default() };
        for (name, view) in tensors.iter() {
            match name.strip_prefix(BEST) {
                Some(name) => checkpoint.best.push((name.to_owned(), view.data().to_vec())),
                None => {
                    let values = view.data().chunks_exact(4);
                    let values = values.map(bytemuck::pod_read_unaligned).collect();
                    checkpoint.arrays.push((name.to_owned(), values));
                }
            }
        }
        checkpoint.best.sort();
        Ok(checkpoint)
    }
}
