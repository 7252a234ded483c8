//! The command `falsify`: a search for a start that fails.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::inputs::{inputs, networks};
use super::options::{Changes, Global, Replace};
use super::progress::Progress;
use super::stored::Stored;
use super::{Outcome, devices, document, folder_of, report};
use crate::backend::Event;
use crate::config::{Config, PolicySource};
use crate::error::{Error, Result};
use crate::files::{Existing, MANIFEST, Staged, is_free, json, make_way};
use crate::model::Plant;
use crate::rollout::Region;
use crate::rounding::number;
use crate::scenario::counterexamples::{COUNTEREXAMPLES, REPLAYED, replayed_csv, starts_csv};
use crate::scenario::falsify::{Against, FalsifyRecord, FalsifySettings, Target, falsify};
use crate::system::Axis;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-falsify";
/// Rollouts unless `--budget` says otherwise.
const DEFAULT_BUDGET: u64 = 200_000;
/// Name of the record of a search.
const RECORD: &str = "falsify.json";

/// What `falsify` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct FalsifyArguments {
    /// Configuration (TOML)
    #[arg(required_unless_present = "around", conflicts_with = "around")]
    pub(super) config: Option<PathBuf>,
    /// Folder that `certify` wrote: look where it claims something, with its configuration
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["profile", "set"])]
    pub(super) around: Option<PathBuf>,
    /// What of that certificate is tried
    #[arg(long, value_enum, default_value_t = Within::Ball, requires = "around")]
    pub(super) within: Within,
    /// Rollouts, at most
    #[arg(long, value_name = "N", default_value_t = DEFAULT_BUDGET)]
    pub(super) budget: u64,
    /// Folder of the results [default: reachcast-falsify]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) replace: Replace,
    #[command(flatten, next_help_heading = "Configuration")]
    pub(super) changes: Changes,
}

/// What of a certificate is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Within {
    /// The set that local growth verified: a ball, an ellipsoid or a box
    Ball,
    /// The whole box
    Box,
    /// The perturbed starts whose nominal one is certified
    Certified,
}

/// What `falsify --json` prints, and [`RECORD`] holds.
#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    record: &'a FalsifyRecord,
    /// Where was looked, in words.
    within: &'a str,
    /// The certificate's claim about the same starts, beside the uniform draws of this search.
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<&'a Against>,
    backend: String,
    device: String,
    events: Vec<Event>,
}

/// Looks for a failing start.
pub(super) fn run(global: &Global, asked: &FalsifyArguments) -> Result<Outcome> {
    match (&asked.around, &asked.config) {
        (Some(folder), _) => {
            let stored = Stored::read(folder)?;
            let plant = stored.config.plant(&stored.policy)?;
            let within = asked.within;
            let mut config = stored.config.clone();
            config.seed = global.changes.seed.unwrap_or(config.seed);
            let target = match within {
                Within::Ball => Target::ball(&stored.record, plant.model.states.len()),
                Within::Certified => Target::certified(&stored.record, &config.spec()?),
                Within::Box => Target::whole_box(&stored.record),
            };
            let target = target.map_err(|e| Error::file(folder, e))?;
            let work = Work { global, asked, config: &config, policy: &stored.policy, target };
            work.run(&plant, folder)
        }
        (None, Some(path)) => {
            let config = Config::load(path, &global.overrides())?;
            let policy = config.policy_source(folder_of(path))?;
            let plant = config.plant(&policy)?;
            let settings = config.settings(&plant.model.states)?;
            let region = Region::new_box(settings.low, settings.high)?;
            let target = Target { region, words: "the box".to_owned(), pairs: None, claim: None };
            Work { global, asked, config: &config, policy: &policy, target }.run(&plant, path)
        }
        (None, None) => {
            Err(Error::invalid("falsify", "give a configuration, or --around a folder"))
        }
    }
}

/// A search for a plant.
struct Work<'a> {
    global: &'a Global,
    asked: &'a FalsifyArguments,
    config: &'a Config,
    policy: &'a PolicySource,
    target: Target,
}

impl Work<'_> {
    fn run(self, plant: &Plant, read: &Path) -> Result<Outcome> {
        let Self { global, asked, config, policy, target } = &self;
        let out = global.folder(DEFAULT_OUT);
        inputs(read, policy, networks(config)).spare_folder(&out)?;
        let manifest = self.manifest()?;
        if global.existing == Existing::Kept {
            is_free(&out, &manifest)?;
        }
        let settings = FalsifySettings {
            region: target.region.clone(),
            pairs: target.pairs.clone(),
            spec: config.spec()?,
            budget: asked.budget,
            seed: config.seed,
        };
        let backend = devices::open(global)?;
        let progress = Progress::new(global);
        let mut staged = Staged::new(&out)?;
        let program = backend.prepare(plant)?;
        let record = falsify(&program, &settings, &progress)?;
        devices::note_events(global, &backend);
        progress.check()?;
        let against = target.claim.as_ref().map(|claim| Against::new(claim, &record));
        let answer = Answer {
            record: &record,
            within: &target.words,
            against: against.as_ref(),
            backend: backend.name().to_owned(),
            device: backend.device(),
            events: backend.events(),
        };
        let answer_document = document(&answer);
        let files = stage(&mut staged, plant, &record, &manifest, &json(RECORD, &answer_document)?);
        files?;
        if global.existing == Existing::Replaced {
            make_way(&out, &manifest)?;
        }
        let files = staged.publish()?;
        report(global, &answer_document, || text(plant, &answer, &files))?;
        Ok(if record.found { Outcome::NotObtained } else { Outcome::Done })
    }

    /// What the folder of a search says that it holds.
    fn manifest(&self) -> Result<String> {
        let digest = match self.policy {
            PolicySource::Network { network, .. } => Some(network.digest()),
            PolicySource::Formula(_) => None,
        };
        let work = serde_json::json!({
            "config": self.config.to_json()?,
            "policy_sha256": digest,
            "within": self.target.words,
            "budget": self.asked.budget,
        });
        json(MANIFEST, &serde_json::json!({ "falsify": work }))
    }
}

/// Writes the files of the folder, the record last.
fn stage(
    staged: &mut Staged,
    plant: &Plant,
    record: &FalsifyRecord,
    manifest: &str,
    answer: &str,
) -> Result<()> {
    let model = &plant.model;
    staged.add(MANIFEST, manifest.as_bytes())?;
    if !record.starts.is_empty() {
        let table = starts_csv(&model.states, &model.parameters, &record.starts);
        staged.add(COUNTEREXAMPLES, table.as_bytes())?;
    }
    if !record.pairs.is_empty() {
        let axes: [&[Axis]; 2] = [&model.states, &model.controls];
        let table = replayed_csv(axes, &model.parameters, &record.pairs);
        staged.add(REPLAYED, table.as_bytes())?;
    }
    staged.add(RECORD, answer.as_bytes())
}

/// What was found, or what was tried.
fn text(plant: &Plant, answer: &Answer<'_>, files: &[PathBuf]) -> String {
    let Answer { record, within, .. } = answer;
    let mut text = match record.found {
        true => format!("a start of {within} fails, on {} and in f64\n", answer.device),
        false => {
            format!("no failing start of {within} was found; that is no proof that there is none\n")
        }
    };
    let FalsifyRecord { rollouts, budget, uniform, uniform_failures, restarts, rounds, .. } =
        record;
    // A String takes whatever is written to it.
    let _ = writeln!(
        text,
        "tried: {rollouts} of {budget} rollouts in {rounds} batches; {uniform} uniform draws, of which \
         {uniform_failures} fail, and {restarts} clouds by cross-entropy and descent; seed {}",
        record.seed
    );
    if let Some(best) = &record.best {
        let names = plant.model.states.iter().map(|axis| axis.name.as_str());
        let at: Vec<String> = names.zip(&best.x).map(|(name, x)| format!("{name} {x}")).collect();
        let _ = writeln!(text, "smallest measure: {} at {}", number(best.measure), at.join(", "));
    }
    if record.unconfirmed > 0 {
        let _ = writeln!(text, "{} fail in f32 alone, and do not count", record.unconfirmed);
    }
    if let Some(against) = &answer.against {
        let _ = writeln!(text, "{}", against.words);
    }
    for file in files {
        let _ = writeln!(text, "file: {}", file.display());
    }
    text
}
