//! The command `rollout`: the reach-avoid measure of each start in a file.

use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use super::inputs::{inputs, networks};
use super::options::Global;
use super::progress::Progress;
use super::{Outcome, caveats, devices, document, folder_of, replayed, report};
use crate::backend::{Event, Program};
use crate::config::Config;
use crate::error::Result;
use crate::files::{MeasureWriter, StateReader, check_room, spare_existing};
use crate::model::{Form, Plant, Task};
use crate::rollout::{
    Keep, MeasureCounts, MeasureTally, Query, ReachAvoidTask, RolloutSpec, Starts, StateList,
    States, Tightening,
};
use crate::rounding;
use crate::scenario::Watch;
use crate::scenario::bound::interval;
use crate::scenario::sampling::sampling;

/// Starts that are held in memory at a time.
const CHUNK: usize = 1 << 18;
/// Starts of the first chunk whose rollouts are looked at for what samples do not tell.
const LOOKED_AT: usize = 16;
/// The most that a measure takes in a file, bytes.
const MEASURE_BYTES: u64 = 16;
/// One minus the confidence of the interval of the success rate.
const BETA: f64 = 0.05;

/// What `rollout --json` prints.
#[derive(Serialize)]
struct Summary {
    starts: u64,
    successes: u64,
    non_finite: u64,
    /// Two-sided 95 % interval of the success rate (Clopper-Pearson).
    #[serde(with = "crate::files::number")]
    success_interval: [f64; 2],
    horizon: u32,
    /// What a rollout has to do; nothing is said of reach-avoid without a window.
    #[serde(skip_serializing_if = "Task::is_plain")]
    task: Task,
    #[serde(with = "crate::files::number")]
    gamma: f32,
    measures: String,
    backend: String,
    device: String,
    /// How an adapter ran networks, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    networks: Option<String>,
    events: Vec<Event>,
    /// What the samples do not tell.
    notes: Vec<String>,
    #[serde(with = "crate::files::number")]
    wall_seconds: f64,
}

/// Rolls the starts out and writes their measures.
pub(super) fn run(global: &Global, path: &Path, starts: &Path, measures: &Path) -> Result<Outcome> {
    let folder = folder_of(path);
    let config = Config::load(path, &global.overrides())?;
    let spec = config.spec()?;
    let policy = config.policy_source(folder)?;
    let read = networks(&config).chain([starts.to_owned()]);
    inputs(path, &policy, read).spare_file(measures)?;
    spare_existing(measures, global.existing)?;
    let work = Rollout { global, spec, starts, measures };
    let plant = config.plant(&policy)?;
    caveats::say(global, &config, &plant);
    let summary = work.run(&plant)?;
    report(global, &document(&summary), || text(&summary))?;
    Ok(Outcome::Done)
}

/// The command for a plant.
struct Rollout<'a> {
    global: &'a Global,
    spec: RolloutSpec,
    starts: &'a Path,
    measures: &'a Path,
}

impl Rollout<'_> {
    fn run(self, plant: &Plant) -> Result<Summary> {
        match replayed::measures(self.starts, &plant.model, &self.spec)? {
            Some(measures) => self.write_replayed(plant.model.task, &measures),
            None => self.roll_out(plant),
        }
    }

    /// Writes the measures of starts that came with their controls.
    fn write_replayed(self, task: Task, measures: &[f32]) -> Result<Summary> {
        let begun = Instant::now();
        let mut writer = MeasureWriter::create(self.measures)?;
        writer.add(measures)?;
        writer.publish()?;
        let mut tally = MeasureTally::new(Keep::Counts);
        tally.add(0, measures)?;
        let done = Done { task, notes: vec![replayed::NOTE.to_owned()], begun, tally };
        Ok(self.summary(done, RanOn::host()))
    }

    fn roll_out(self, plant: &Plant) -> Result<Summary> {
        let names = plant.model.states.iter().map(|axis| axis.name.clone()).collect();
        let mut reader = StateReader::open(self.starts, names)?;
        let backend = devices::open(self.global)?;
        let program = backend.prepare(plant)?;
        let mut writer = MeasureWriter::create(self.measures)?;
        check_room(folder_of(self.measures), MEASURE_BYTES * reader.left().unwrap_or(0))?;
        let progress = Progress::new(self.global);
        let begun = Instant::now();
        progress.begin("rollouts", reader.left().unwrap_or(0));
        let (mut tally, mut notes) = (MeasureTally::new(Keep::Counts), Vec::new());
        loop {
            let starts = reader.next(CHUNK)?;
            if starts.is_empty() {
                break;
            }
            if notes.is_empty() {
                let stride = starts.len().div_ceil(LOOKED_AT);
                let few = StateList::new(starts.view().size()).with(starts.iter().step_by(stride));
                notes = sampling(plant, few.view(), self.spec.horizon);
            }
            measure(&program, self.spec, starts.view(), &mut |values| {
                tally.add(tally.counts().starts, values)?;
                writer.add(values)?;
                progress.advance(values.len() as u64)
            })?;
        }
        writer.publish()?;
        devices::note_events(self.global, &backend);
        let done = Done { task: plant.model.task, notes, begun, tally };
        Ok(self.summary(done, RanOn::program(&program)))
    }

    /// What is reported of rollouts that are done.
    fn summary(self, done: Done, on: RanOn) -> Summary {
        let Done { task, notes, begun, tally } = done;
        let MeasureCounts { starts, successes, non_finite, .. } = *tally.counts();
        let (low, high) = interval(successes, starts, BETA);
        Summary {
            starts,
            successes,
            non_finite,
            success_interval: [low, high],
            horizon: self.spec.horizon,
            task,
            gamma: self.spec.gamma,
            measures: self.measures.display().to_string(),
            backend: on.backend,
            device: on.device,
            networks: on.networks,
            events: on.events,
            notes,
            wall_seconds: begun.elapsed().as_secs_f64(),
        }
    }
}

/// Who rolled out.
struct RanOn {
    backend: String,
    device: String,
    networks: Option<String>,
    events: Vec<Event>,
}

impl RanOn {
    /// The backend of `program`.
    fn program(program: &Program<'_>) -> Self {
        let backend = program.backend();
        Self {
            backend: backend.name().to_owned(),
            device: backend.device(),
            networks: program.networks(),
            events: backend.events(),
        }
    }

    /// Nobody but the host.
    fn host() -> Self {
        let (backend, device) = ("cpu".to_owned(), "the host, in f64".to_owned());
        Self { backend, device, networks: None, events: Vec::new() }
    }
}

/// Rollouts that are done.
struct Done {
    task: Task,
    notes: Vec<String>,
    begun: Instant,
    tally: MeasureTally,
}

/// Sends the measures of `starts` to `sink`, in order.
fn measure(
    program: &Program<'_>,
    spec: RolloutSpec,
    starts: States<'_>,
    sink: &mut dyn FnMut(&[f32]) -> Result<()>,
) -> Result<()> {
    let task = ReachAvoidTask {
        starts: Starts::Listed(starts),
        range: 0..starts.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    program.reach_avoid(&task, &mut |_, values| sink(values))
}

/// The summary in words.
fn text(summary: &Summary) -> String {
    let Summary { starts, successes, non_finite, success_interval, .. } = summary;
    let notes: String = summary.notes.iter().map(|note| format!("note: {note}\n")).collect();
    let (task, horizon) = (&summary.task, summary.horizon);
    let success = match task.is_plain() {
        true => "the target is reached safely".to_owned(),
        false => format!("a start {}", task.words(Form::One, horizon)),
    };
    let share = 100.0 * *successes as f64 / *starts as f64;
    format!(
        "{successes} of {starts} starts {}: {} % (95 % interval {} %)\n\
         {non_finite} failed for a state that is not finite\n\
         measures (positive where {success}): {}\n\
         {horizon} steps, {}, {} s\n{notes}",
        task.short_words(Form::Many, horizon),
        rounding::number(share),
        rounding::interval(success_interval.map(|end| 100.0 * end)),
        summary.measures,
        summary.device,
        rounding::number(summary.wall_seconds)
    )
}
