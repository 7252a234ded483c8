//! Training in a program that was built with it.

mod reinforced;
mod use_of;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::backend::{Backend, Program};
use crate::cli::options::{BackendName, Global};
use crate::cli::progress::Progress;
use crate::cli::{Outcome, devices, report};
use crate::config::Config;
use crate::error::Result;
use crate::files::{Existing, Staged, json};
use crate::model::{Model, Plant};
use crate::policy::Activation;
use crate::report::train_html;
use crate::rollout::{Purpose, RolloutSpec, Stream};
use crate::rounding::number;
use crate::scenario::settings::Settings;
use crate::scenario::{Context, provenance, tightened};
use crate::system::Axis;
use crate::train::analytic::{Analytic, LAST, Task};
use crate::train::chosen::chosen_first;
use crate::train::device::Device;
use crate::train::network::{Architecture, Network};
use crate::train::purpose;
use crate::train::record::{Origin, TrainRecord};
use crate::train::run::{Learner, Run, Trained};
use crate::train::samples::Source;
use crate::train::settings::{Method, TrainSettings};
use crate::train::value::{Lesson, Value};

/// Bytes that a training frees and takes at every iteration, and no more than glibc heeds.
const KEPT: usize = 24 << 20;

/// Trains, stores in `out` and reports; `folder` is that of the configuration.
pub(super) fn run(global: &Global, config: &Config, folder: &Path, out: &Path) -> Result<Outcome> {
    let begun = Instant::now();
    keep_memory();
    let (backend, progress) = (opened(global)?, Progress::new(global));
    let device = Device::of(&backend)?;
    let settings = config.train_settings()?;
    let existing = global.existing;
    let (backend_used, watch) = (&backend, &progress);
    let training =
        Training { config, settings, backend: backend_used, device, watch, out, existing };
    let mut trained = training.run(folder)?;
    progress.finish();
    devices::note_events(global, &backend);
    trained.record.events = backend.events();
    trained.record.policy = use_of::section(config)?;
    let files = write(out, &trained)?;
    let seconds = begun.elapsed().as_secs_f64();
    let used = use_of::words(config, folder, out)?;
    report(global, &trained.record, || text(&trained.record, &files, seconds) + &used)?;
    Ok(Outcome::Done)
}

/// The backend that the flags ask for; of a program without tensors on adapters, `auto` is the CPU.
fn opened(global: &Global) -> Result<Backend> {
    let unasked = global.common.backend == BackendName::Auto && global.common.device.is_none();
    match unasked && cfg!(not(feature = "train-gpu")) {
        true => devices::cpu(global).map(Backend::Cpu),
        false => devices::open(global),
    }
}

/// Keeps the C library from handing memory back to the system after each iteration, only to ask for
/// it again: glibc keeps about twice the largest block that it has freed. A fifth of the time.
fn keep_memory() {
    std::hint::black_box(Vec::<u8>::with_capacity(KEPT));
}

/// What training works with.
struct Training<'a> {
    config: &'a Config,
    settings: &'a TrainSettings,
    backend: &'a Backend,
    device: Device,
    watch: &'a Progress,
    out: &'a Path,
    existing: Existing,
}

impl Training<'_> {
    /// A random network, its last layer `last` times as large as the others.
    fn network(
        &self,
        inputs: Vec<[f32; 2]>,
        outputs: usize,
        output: Activation,
        last: f32,
    ) -> Network {
        let hidden = self.settings.hidden.clone();
        let shape = Architecture { inputs, hidden, outputs, activation: Activation::Relu, output };
        Network::random(shape, Stream::new(self.config.seed, purpose::WEIGHT, 0), last)
    }

    /// Trains `learner`, on the plant of `program` or from its policy on, for `total` iterations.
    fn train(
        &self,
        learner: &mut dyn Learner,
        total: u64,
        program: &Program<'_>,
    ) -> Result<Trained> {
        let config = self.config.to_train_json()?;
        let provenance = provenance(program, self.config.seed, config);
        let origin = Origin { method: self.settings.method, provenance };
        let TrainSettings { interval, patience, .. } = *self.settings;
        let run = Run { folder: self.out, origin, total, interval, patience };
        if self.existing == Existing::Replaced {
            run.make_way()?;
        }
        self.device.contained(|| run.train(learner, self.watch))
    }
}

impl Training<'_> {
    /// Does the work.
    fn run(self, folder: &Path) -> Result<Trained> {
        let model = Arc::new(self.config.plain_model()?);
        self.settings.method.check_task(&model.task)?;
        self.settings.method.check_points(model.points)?;
        match self.settings.method {
            Method::Analytic => self.analytic(&model),
            Method::Ddpg => self.ddpg(&model),
            Method::Ppo => self.ppo(&model),
            Method::Value | Method::ActionValue => {
                let plant = self.config.plant(&self.config.policy_source(folder)?)?;
                self.value(&plant)
            }
        }
    }

    /// A policy of `model` through its dynamics.
    fn analytic(self, model: &Arc<Model>) -> Result<Trained> {
        let Self { config, settings, backend, watch, .. } = self;
        let task = self.task(model)?;
        task.check_room(&settings.hidden, settings.analytic.batch)?;
        let interface = task.interface.clone();
        let inputs = interface.intervals(&self.intervals(model)?);
        let network = self.network(inputs, interface.outputs, Activation::Tanh, LAST);
        // On a plant that is linear in the state, replayed controls deviate by the same under any
        // policy; on others this is the deviation under the untrained one.
        let policy = network.export(interface.order(model))?;
        let program = backend.prepare(&interface.plant(model, policy))?;
        let context = Context { program: &program, watch };
        let tightening = match settings.analytic.certified > 0.0 {
            true => {
                // Gradients run through constants and the deviation bound of the untrained policy.
                let settings =
                    Settings { drops: None, enclosed: None, ..config.settings(&model.states)? };
                Some(tightened(context, &settings)?.tightening)
            }
            false => None,
        };
        let gamma = settings.analytic.gamma.unwrap_or(f64::from(task.spec.gamma));
        let spec = RolloutSpec::new(task.spec.horizon, gamma as f32)?;
        let task = Task { tightening, spec, ..task };
        let mut learner = Analytic::new(task, network, settings.analytic);
        self.train(&mut learner, settings.analytic.iterations, &program)
    }

    /// What rollouts of `plant` are worth.
    fn value(self, plant: &Plant) -> Result<Trained> {
        let Self { config, settings, backend, .. } = self;
        let model = &plant.model;
        let program = backend.prepare(plant)?;
        let source = Source {
            program: &program,
            spec: config.settings(&model.states)?.spec,
            mixture: &config.mixture(&model.states)?,
            visited: settings.value.visited,
            seed: config.seed,
        };
        let (mut inputs, mut order) = (self.intervals(model)?, names(&model.states));
        let acts = settings.method == Method::ActionValue;
        if acts {
            inputs.extend(model.controls.iter().map(|axis| [axis.low, axis.high]));
            order.extend(names(&model.controls));
        }
        let chosen = acts.then(|| chosen_first(plant));
        let chosen = chosen.as_ref().map(|chosen| backend.prepare(chosen)).transpose()?;
        let samples = |purpose: Purpose, count: u64| match &chosen {
            Some(chosen) => source.action_values(chosen, purpose, count as usize),
            None => source.values(purpose, count as usize),
        };
        let lesson = Lesson {
            name: if acts { "action_value" } else { "value" },
            order,
            samples: samples(purpose::START, settings.value.states)?,
            held_out: samples(purpose::HELD_OUT, settings.held_out)?,
            device: self.device.clone(),
            seed: config.seed,
        };
        let network = self.network(inputs, 1, Activation::Identity, 1.0);
        let mut learner = Value::new(lesson, network, settings.value)?;
        self.train(&mut learner, settings.value.iterations, &program)
    }
}

/// Names of axes, in order.
fn names(axes: &[Axis]) -> Vec<String> {
    axes.iter().map(|axis| axis.name.clone()).collect()
}

/// Writes the results.
fn write(out: &Path, trained: &Trained) -> Result<Vec<PathBuf>> {
    let mut staged = Staged::new(out)?;
    for (name, bytes) in &trained.files {
        staged.add(name, bytes)?;
    }
    staged.add("curve.csv", &trained.record.table().csv()?)?;
    staged.add("report.html", train_html(&trained.record).as_bytes())?;
    staged.add("train.json", json("train.json", &trained.record)?.as_bytes())?;
    staged.publish()
}

/// The result as a page of text.
fn text(record: &TrainRecord, files: &[PathBuf], seconds: f64) -> String {
    let mut text = String::new();
    let mut line = |parts: std::fmt::Arguments<'_>| {
        // A String takes whatever is written to it.
        let _ = writeln!(text, "{parts}");
    };
    let best = record.curve.iter().find(|point| point.iteration == record.best);
    for (name, score) in record.scores.iter().zip(best.iter().flat_map(|best| &best.scores)) {
        line(format_args!("{name}: {}", number(*score)));
    }
    let early = if record.stopped_early { ", ended early" } else { "" };
    line(format_args!("best after {} of {} iterations{early}", record.best, record.total));
    for network in &record.networks {
        line(format_args!("{} {}", network.file, network.sha256));
    }
    line(format_args!("{} s", number(seconds)));
    for note in &record.notes {
        line(format_args!("note: {note}"));
    }
    for file in files {
        line(format_args!("{}", file.display()));
    }
    text
}
