//! The command `race`: whole races of many controllers, judged, compared and reported.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::arguments::RaceArguments;
use super::input::{RaceInput, RaceStarts, names, noise_seeds};
use crate::cli::options::Global;
use crate::cli::progress::Progress;
use crate::cli::{Outcome, devices, document, report};
use crate::error::Result;
use crate::files::{Existing, Staged, json};
use crate::race::page::race_html;
use crate::race::record::{ControllerRecord, JudgedRecord, RaceRecord};
use crate::race::run::{Experiment, RaceResults};
use crate::race::timing::TimingRecord;
use crate::rounding::{interval, number, upper};

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-race";

/// Steps of samples from which on the work is told.
const TOLD: f64 = 1e11;
/// Steps of samples that a core does in a second, about: the README's plans without a network.
const STEPS_PER_CORE: f64 = 2e8;
/// What the columns of the table are.
const LEGEND: &str = "\
Judges say what a safe win is. study: the published code's distance in space and the gate at the crossing;
paper: a positive constraint with the squared cone; rigorous: the same with the cone as a distance.
published: the study's rate; ms, share: mean wall time of a step of the batch over the races under way;
unsafe starts aside: the share of starts that violate no rule before anyone moves";

/// What `timing.json` holds: it differs from run to run, so it is no part of the results.
#[derive(Serialize)]
struct Timing {
    #[serde(with = "crate::files::number")]
    wall_seconds: f64,
    threads: usize,
    controllers: Vec<TimingRecord>,
}

/// Races what the configuration asks for.
pub(super) fn run(global: &Global, asked: &RaceArguments) -> Result<Outcome> {
    let begun = Instant::now();
    let input = RaceInput::load(&asked.config, &global.overrides())?;
    let names = names(&asked.controllers)?;
    let noise_seeds = noise_seeds(input.config.seed, asked.noise_seeds)?;
    let RaceStarts { states, source } = input.starts(asked.starts.as_deref())?;
    let out = global.folder(DEFAULT_OUT);
    input.inputs(&asked.config, asked.starts.as_deref()).spare_folder(&out)?;
    let progress = Progress::new(global);
    let backend = devices::open(global)?;
    let plant = input.plant()?;
    let program = backend.prepare(&plant)?;
    let experiment = Experiment {
        world: input.world(&backend, &program)?,
        names,
        starts: states,
        source,
        noise_seeds,
        config: input.config.to_json()?,
        folder: out.clone(),
    };
    let placed = |error| input.config.placed(error);
    if global.existing == Existing::Replaced {
        experiment.make_way().map_err(placed)?;
    }
    estimate(global, &experiment);
    let RaceResults { record, timings } = experiment.run(&progress).map_err(placed)?;
    progress.finish();
    devices::note_events(global, &backend);
    let wall_seconds = begun.elapsed().as_secs_f64();
    let timing = Timing { wall_seconds, threads: devices::threads(global), controllers: timings };
    let files = write(&out, &record, &timing)?;
    report(global, &record, || text(&record, &timing, &files))?;
    Ok(Outcome::Done)
}

/// Says how much work it is where that takes more than minutes.
fn estimate(global: &Global, experiment: &Experiment<'_>) {
    let work = experiment.sample_steps(&experiment.names);
    if work > TOLD && !global.common.quiet {
        let text = format!("note: the plans roll out up to {work:.1e} steps of samples, about");
        let hours = work / STEPS_PER_CORE / 3600.0;
        // Nobody reads what a closed pipe does not take.
        let _ = writeln!(std::io::stderr(), "{text} {hours:.1} hours of a core, if none is stored");
    }
}

/// Writes the results.
fn write(out: &Path, record: &RaceRecord, timing: &Timing) -> Result<Vec<PathBuf>> {
    let mut staged = Staged::new(out)?;
    staged.add("report.html", race_html(record).as_bytes())?;
    staged.add("timing.json", json("timing.json", &document(timing))?.as_bytes())?;
    staged.add("results.json", json("results.json", record)?.as_bytes())?;
    staged.publish()
}

/// The results as a page of text.
fn text(record: &RaceRecord, timing: &Timing, files: &[PathBuf]) -> String {
    let mut text = format!(
        "{} races per controller and noise seed ({}), noise seeds {:?}\n\
         Mean rate over the seeds, and the 95 % interval of the first seed's run\n\n",
        record.starts.count, record.starts.source, record.noise_seeds
    );
    let mut line = |parts: std::fmt::Arguments<'_>| {
        // A String takes whatever is written to it.
        let _ = writeln!(text, "{parts}");
    };
    line(format_args!(
        "{:20} {:>24} {:>9} {:>24} {:>24} {:>10}",
        "controller", "study judge", "published", "paper judge", "rigorous judge", "ms, share"
    ));
    for controller in &record.controllers {
        let [study, paper, rigorous] = [0, 1, 2].map(|i| rate(&controller.judged[i]));
        let milliseconds = timing
            .controllers
            .iter()
            .find(|timing| timing.name == controller.name)
            .map_or(0.0, |timing| 1e3 * timing.mean_seconds);
        let name = &controller.name;
        let published = published(controller);
        line(format_args!(
            "{name:20} {study:>24} {published:>9} {paper:>24} {rigorous:>24} {milliseconds:>10.3}"
        ));
    }
    let ceiling = |i: usize| {
        let share = record.starts.ceilings[i].safe as f64 / record.starts.count as f64;
        format!("at most {} %", upper(100.0 * share))
    };
    let [study, paper, rigorous] = [0, 1, 2].map(ceiling);
    line(format_args!(
        "{:20} {study:>24} {:>9} {paper:>24} {rigorous:>24}",
        "unsafe starts aside", ""
    ));
    for absent in &record.absent {
        line(format_args!("{:20} did not run: {}", absent.name, absent.reason));
    }
    line(format_args!("{LEGEND}"));
    for note in &record.notes {
        line(format_args!("note: {note}"));
    }
    line(format_args!("\n{} s on {}", number(timing.wall_seconds), record.provenance.device));
    for file in files {
        line(format_args!("{}", file.display()));
    }
    text
}

/// A rate with its interval.
fn rate(judged: &JudgedRecord) -> String {
    let ends = judged.interval.map(|end| 100.0 * end);
    format!("{} % ({})", number(100.0 * judged.rate), interval(ends))
}

/// The published rate.
fn published(controller: &ControllerRecord) -> String {
    let published = controller.judged[0].published;
    published.map_or_else(String::new, |published| format!("{} %", number(100.0 * published.rate)))
}
