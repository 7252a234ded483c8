//! A run of training: updates, scores, the best networks kept; stopped and resumed anywhere.

use std::path::Path;
use std::time::{Duration, Instant};

use super::checkpoint::{Checkpoint, RunProgress};
use super::doubts::doubts;
use super::record::{CurvePoint, NetworkRecord, Origin, TRAIN_SCHEMA, TrainRecord};
use crate::error::{Error, Result};
use crate::files::{Claim, MANIFEST, json, make_way};
use crate::policy::Mlp;
use crate::scenario::Watch;

/// A checkpoint is not written again sooner than this, but at the end and when interrupted.
const PERIOD: Duration = Duration::from_secs(10);
/// Room for networks, checkpoints and the page, bytes.
const ROOM_BYTES: u64 = 16 << 20;

/// Something that learns by updates, each a function of what it holds and the update's number.
pub trait Learner {
    /// Update number `iteration`, counted from 0; returns its loss.
    ///
    /// # Errors
    /// Those of the work.
    fn update(&mut self, iteration: u64) -> Result<f64>;

    /// What the scores are, the one that decides first.
    fn score_names(&self) -> Vec<String>;

    /// The scores of the networks as they are, on what they are not trained on; larger is better.
    ///
    /// # Errors
    /// Those of the device.
    fn scores(&self) -> Result<Vec<f64>>;

    /// Whether networks with the scores `new` are better than those with the scores `old`.
    fn is_better(&self, new: &[f64], old: &[f64]) -> bool {
        new[0] > old[0]
    }

    /// The networks, each with the name of its file without ending, in the order of the names.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a parameter is not finite.
    fn networks(&self) -> Result<Vec<(&'static str, Mlp)>>;

    /// Everything that a later update depends on, by name, to be stored and restored.
    fn arrays(&mut self) -> Vec<(&'static str, &mut Vec<f32>)>;
}

/// How long to train, and where the results go.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The folder of the run.
    pub folder: &'a Path,
    /// What the run depends on.
    pub origin: Origin,
    /// Iterations.
    pub total: u64,
    /// Iterations between two scores.
    pub interval: u64,
    /// Scores without a better one after which training ends; 0 for never.
    pub patience: u64,
}

/// What training comes to: its record, and the files of the best networks by name.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The record.
    pub record: TrainRecord,
    /// Names of files with their bytes.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Run<'_> {
    /// Trains `learner` to the end, from where the folder's checkpoint is if it has one.
    ///
    /// # Errors
    /// [`Error::File`] if the folder is of another run or its checkpoint is damaged,
    /// [`Error::Invalid`] if the loss is not finite, [`Error::Interrupted`] after a checkpoint was
    /// written, and those of the learner.
    pub fn train(&self, learner: &mut dyn Learner, watch: &dyn Watch) -> Result<Trained> {
        let _claim = Claim::new(self.folder, &self.manifest()?, ROOM_BYTES)?;
        let mut standing = match Checkpoint::read(self.folder)? {
            Some(stored) => self.restored(learner, stored)?,
            None => self.begun(learner)?,
        };
        watch.begin(&format!("training, {}", self.origin.method.name()), self.total);
        watch.advance(standing.progress.iteration)?;
        let mut written = Instant::now();
        while standing.progress.iteration < self.total && !standing.progress.stopped_early {
            self.advance(learner, &mut standing)?;
            let interrupted = watch.advance(1);
            if interrupted.is_err() || written.elapsed() > PERIOD {
                store(learner, &mut standing, self.folder)?;
                written = Instant::now();
            }
            interrupted?;
        }
        store(learner, &mut standing, self.folder)?;
        self.trained(learner, standing)
    }

    /// Removes the results of other work from the folder.
    ///
    /// # Errors
    /// [`Error::Write`] if they cannot be removed.
    pub fn make_way(&self) -> Result<()> {
        make_way(self.folder, &self.manifest()?)
    }

    /// What the folder says that it holds.
    fn manifest(&self) -> Result<String> {
        json(MANIFEST, &self.origin)
    }

    /// The state of a run that has not begun: scored once.
    fn begun(&self, learner: &mut dyn Learner) -> Result<Checkpoint> {
        let mut standing = Checkpoint::default();
        self.score(learner, &mut standing, None)?;
        Ok(standing)
    }

    /// The stored run, its arrays handed to the learner.
    fn restored(&self, learner: &mut dyn Learner, stored: Checkpoint) -> Result<Checkpoint> {
        for (name, array) in learner.arrays() {
            let found = stored.arrays.iter().find(|(known, _)| known == name);
            match found {
                Some((_, values)) if values.len() == array.len() => array.clone_from(values),
                _ => {
                    let problem = format!("the checkpoint has no `{name}` of the right size");
                    return Err(Error::file(self.folder, problem));
                }
            }
        }
        Ok(stored)
    }

    /// One update, and a score where one is due.
    fn advance(&self, learner: &mut dyn Learner, standing: &mut Checkpoint) -> Result<()> {
        let loss = learner.update(standing.progress.iteration)?;
        if !loss.is_finite() {
            let problem = match standing.progress.iteration {
                // Nothing has moved the parameters yet.
                0 => format!(
                    "the loss is {loss} at the first iteration: a state or a margin of some rollout under the \
                     untrained policy is not finite; starts (`train.starts`) or formulas that keep to where they \
                     are defined do not do that"
                ),
                iteration => {
                    format!(
                        "the loss is {loss} at iteration {iteration}; lower the optimiser's `rate`"
                    )
                }
            };
            return Err(Error::invalid(format!("train.{}", self.origin.method.name()), problem));
        }
        standing.progress.iteration += 1;
        standing.progress.loss += loss;
        let done = standing.progress.iteration;
        if done.is_multiple_of(self.interval) || done == self.total {
            let since = standing.progress.curve.last().map_or(0, |point| point.iteration);
            let mean = standing.progress.loss / (done - since) as f64;
            standing.progress.loss = 0.0;
            self.score(learner, standing, Some(mean))?;
        }
        Ok(())
    }

    /// Scores the networks, keeps them if they are the best, and ends a run that gets no better.
    fn score(
        &self,
        learner: &mut dyn Learner,
        standing: &mut Checkpoint,
        loss: Option<f64>,
    ) -> Result<()> {
        let scores = learner.scores()?;
        let RunProgress { iteration, curve, best, stopped_early, .. } = &mut standing.progress;
        let record = curve.iter().find(|point| point.iteration == *best);
        if record.is_none_or(|record| learner.is_better(&scores, &record.scores)) {
            *best = *iteration;
            let networks = learner.networks()?.into_iter();
            standing.best = networks.map(|(name, mlp)| (name.to_owned(), mlp.to_bytes())).collect();
        }
        curve.push(CurvePoint { iteration: *iteration, loss, scores });
        let since = curve.iter().filter(|point| point.iteration > *best).count() as u64;
        *stopped_early = self.patience > 0 && since >= self.patience && *iteration < self.total;
        Ok(())
    }

    /// The record of a run that has ended.
    fn trained(&self, learner: &dyn Learner, standing: Checkpoint) -> Result<Trained> {
        let Checkpoint { progress, best, .. } = standing;
        let (mut files, mut networks) = (Vec::new(), Vec::new());
        for (name, bytes) in best {
            let file = format!("{name}.safetensors");
            let mlp = Mlp::from_bytes(&bytes)
                .map_err(|problem| Error::file(&self.folder.join(&file), problem))?;
            networks.push(NetworkRecord {
                file: file.clone(),
                sha256: mlp.digest(),
                widths: mlp.widths(),
            });
            files.push((file, bytes));
        }
        let mut record = TrainRecord {
            schema: TRAIN_SCHEMA,
            origin: self.origin.clone(),
            total: self.total,
            stopped_early: progress.stopped_early,
            best: progress.best,
            scores: learner.score_names(),
            curve: progress.curve,
            networks,
            policy: None,
            notes: Vec::new(),
            events: Vec::new(),
        };
        record.notes = doubts(&record);
        Ok(Trained { record, files })
    }
}

/// Writes where the run stands.
fn store(learner: &mut dyn Learner, standing: &mut Checkpoint, folder: &Path) -> Result<()> {
    let arrays = learner.arrays().into_iter();
    standing.arrays = arrays.map(|(name, values)| (name.to_owned(), values.clone())).collect();
    standing.write(folder)
}
