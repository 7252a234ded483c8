//! The command `race`: whole races of many controllers, judged, compared and reported.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;

use super::args::{Global, RaceArguments};
use super::progress::Progress;
use super::{Outcome, devices, folder_of, json, report};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::experiment::controller::{Name, World};
use crate::experiment::record::{ControllerRecord, JudgedRecord, RaceRecord};
use crate::experiment::run::{Experiment, TimingRecord};
use crate::experiment::settings::RaceSettings;
use crate::files::{Staged, StateReader};
use crate::policy::Mlp;
use crate::report::race_html;
use crate::rollout::{Purpose, Region, Starts, Stream};
use crate::system::{DroneRace, System};

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-race";
/// Most starts that can be drawn.
const MOST_STARTS: u64 = 1_000_000;
/// Most noise seeds.
const MOST_SEEDS: u64 = 1000;

/// What `timing.json` holds: it differs from run to run, so it is no part of the results.
#[derive(Serialize)]
struct Timing {
    wall_seconds: f64,
    threads: usize,
    controllers: Vec<TimingRecord>,
}

/// Races what the configuration asks for.
pub(super) fn run(global: &Global, asked: &RaceArguments) -> Result<Outcome> {
    let begun = Instant::now();
    let config = Config::load(&asked.config, &global.overrides())?;
    let race = config.race.clone().ok_or_else(|| {
        let problem = "only the system `drone-race` has races";
        Error::invalid(asked.config.display().to_string(), problem)
    })?;
    let names = names(&asked.controllers)?;
    if !(1..=MOST_SEEDS).contains(&asked.noise_seeds) {
        let problem = format!("{} is not within 1..={MOST_SEEDS}", asked.noise_seeds);
        return Err(Error::invalid("--noise-seeds", problem));
    }
    let folder = folder_of(&asked.config);
    let policy = config.policy_source(folder)?;
    let out = global.out.clone().unwrap_or_else(|| PathBuf::from(DEFAULT_OUT));
    let networks = Networks::read(&race, folder)?;
    let (starts, source) = starts(&race, folder, asked.starts.as_deref(), config.seed)?;
    let progress = Progress::new(global);
    let certificates = config.settings(&DroneRace::default().states())?;
    let backend = devices::open(global)?;
    let (system, policy) = config.race_plant(&policy)?;
    let world = World {
        backend: &backend,
        system: &system,
        policy,
        value: networks.value.as_ref(),
        disturbance: networks.disturbance.as_ref(),
        ppo: networks.ppo.as_ref(),
        race: &race,
        certificates: &certificates,
    };
    let experiment = Experiment {
        world,
        names,
        starts,
        source,
        noise_seeds: (0..asked.noise_seeds).map(|i| config.seed.wrapping_add(i)).collect(),
        config: config.to_json()?,
        folder: out.clone(),
    };
    let (record, controllers) = experiment.run(&progress)?;
    progress.finish();
    let wall_seconds = begun.elapsed().as_secs_f64();
    let timing = Timing { wall_seconds, threads: devices::threads(global), controllers };
    let files = write(&out, &record, &timing)?;
    report(global, &record, || text(&record, &timing, &files))?;
    Ok(Outcome::Done)
}

/// The controllers of a list of names, each once, in its order.
fn names(list: &[String]) -> Result<Vec<Name>> {
    let mut names = Vec::new();
    for text in list {
        let more = match text.as_str() {
            "all" => Name::STUDY.to_vec(),
            "ablations" => Name::ABLATIONS.to_vec(),
            "improvements" => Name::IMPROVEMENTS.to_vec(),
            _ => vec![name(text)?],
        };
        let new: Vec<Name> = more.into_iter().filter(|name| !names.contains(name)).collect();
        names.extend(new);
    }
    Ok(names)
}

/// The controller of a name.
fn name(text: &str) -> Result<Name> {
    let known = Name::value_variants();
    known.iter().copied().find(|name| name.text() == text).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|name| name.text()).collect();
        let distance = |name: &&&str| strsim::damerau_levenshtein(text, name);
        let nearest = names.iter().min_by_key(distance).copied().unwrap_or_default();
        let problem = format!(
            "no controller `{text}`; did you mean `{nearest}`? There are all, ablations, improvements, \
             {}",
            names.join(", ")
        );
        Error::invalid("--controllers", problem)
    })
}

/// The networks beside the policy.
struct Networks {
    value: Option<Mlp>,
    disturbance: Option<Mlp>,
    ppo: Option<Mlp>,
}

impl Networks {
    /// Reads the files that the configuration in `folder` names.
    fn read(race: &RaceSettings, folder: &Path) -> Result<Self> {
        let states = DroneRace::default().states();
        let names = states.each_ref().map(|axis| axis.name.as_str());
        let read = |file: &str, outputs: usize| {
            if file.is_empty() {
                return Ok(None);
            }
            let path = folder.join(file);
            let network = Mlp::load(&path)?;
            let fits = network.check_fits(&names, outputs);
            fits.map_err(|problem| Error::file(&path, problem))?;
            Ok(Some(network))
        };
        let files = &race.networks;
        Ok(Self {
            value: read(&files.value, 1)?,
            disturbance: read(&files.disturbance, 3)?,
            ppo: read(&files.ppo, 3)?,
        })
    }
}

/// The starts: drawn, of a file, or those of the configuration; and where they come from.
fn starts(
    race: &RaceSettings,
    folder: &Path,
    asked: Option<&str>,
    seed: u64,
) -> Result<(Vec<[f32; 12]>, String)> {
    if let Some(count) = asked.and_then(|text| text.parse::<u64>().ok()) {
        return drawn(race, count, seed);
    }
    let path = asked.map_or_else(|| folder.join(&race.starts), PathBuf::from);
    let names = DroneRace::default().states().map(|axis| axis.name);
    let starts = StateReader::<12>::open(&path, names)?.rest()?;
    // Its name alone: the same starts elsewhere are the same experiment.
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok((starts, name))
}

/// `count` starts drawn from the box of the configuration.
fn drawn(race: &RaceSettings, count: u64, seed: u64) -> Result<(Vec<[f32; 12]>, String)> {
    if !(1..=MOST_STARTS).contains(&count) {
        let problem = format!("{count} is not within 1..={MOST_STARTS}");
        return Err(Error::invalid("--starts", problem));
    }
    let place = "race.start_box";
    let corners: [[f64; 2]; 12] = race.start_box.as_slice().try_into().map_err(|_| {
        let problem = format!("{} intervals, expected 12, one per state", race.start_box.len());
        Error::invalid(place, problem)
    })?;
    let region =
        Region::new_box(corners.map(|[low, _]| low as f32), corners.map(|[_, high]| high as f32));
    let region = region.map_err(|error| Error::invalid(place, error.to_string()))?;
    let starts = Starts::Drawn { region, stream: Stream::new(seed, Purpose::RaceStart, 0) };
    let source = format!("{count} drawn from the start box with seed {seed}");
    Ok(((0..count).map(|i| starts.start(i)).collect(), source))
}

/// Writes the results.
fn write(out: &Path, record: &RaceRecord, timing: &Timing) -> Result<Vec<PathBuf>> {
    let mut staged = Staged::new(out)?;
    staged.add("report.html", race_html(record).as_bytes())?;
    staged.add("timing.json", json("timing.json", timing)?.as_bytes())?;
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
        format!("at most {:.1} %", 100.0 * share)
    };
    let [study, paper, rigorous] = [0, 1, 2].map(ceiling);
    line(format_args!(
        "{:20} {study:>24} {:>9} {paper:>24} {rigorous:>24}",
        "unsafe starts aside", ""
    ));
    for absent in &record.absent {
        line(format_args!("{:20} did not run: {}", absent.name, absent.reason));
    }
    line(format_args!("\n{:.1} s on {}", timing.wall_seconds, record.provenance.device));
    for file in files {
        line(format_args!("{}", file.display()));
    }
    text
}

/// A rate with its interval.
fn rate(judged: &JudgedRecord) -> String {
    let [low, high] = judged.interval.map(|end| 100.0 * end);
    format!("{:.1} % ({low:.1} to {high:.1})", 100.0 * judged.rate)
}

/// The published rate.
fn published(controller: &ControllerRecord) -> String {
    let published = controller.judged[0].published;
    published.map_or_else(String::new, |published| format!("{:.1} %", 100.0 * published.rate))
}
