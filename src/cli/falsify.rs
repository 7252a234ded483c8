//! The command `falsify`: a search for a start that fails.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::falsified::{answer, fixed, stage, text};
use super::inputs::{inputs, networks};
use super::options::{Changes, Global, Replace};
use super::progress::Progress;
use super::stored::Stored;
use super::{Outcome, devices, document, folder_of, report};
use crate::config::{Config, PolicySource};
use crate::digest::sha256;
use crate::error::{Error, Result};
use crate::files::{Existing, MANIFEST, Staged, StateReader, is_free, json, make_way};
use crate::model::Plant;
use crate::report::Search;
use crate::rollout::{Ball, Region, StateList};
use crate::scenario::falsify::{Against, FalsifySettings, Target, falsify, roll_out};
use crate::scenario::limits::positive_f32;
use crate::scenario::provenance;
use crate::scenario::settings::Settings;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-falsify";
/// Rollouts unless `--budget` says otherwise.
const DEFAULT_BUDGET: u64 = 200_000;

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
    /// Look in a ball of this radius around the configuration's state, in the coordinates that growth varies,
    /// and not in the box
    #[arg(long, value_name = "R", conflicts_with_all = ["around", "half_width"])]
    pub(super) radius: Option<f64>,
    /// Look in the box of this half-width around that state, in the same coordinates
    #[arg(long, value_name = "H", conflicts_with = "around")]
    pub(super) half_width: Option<f64>,
    /// Starts (.npy or .csv) that are all rolled out and counted, beside the budget
    #[arg(long, value_name = "FILE")]
    pub(super) starts: Option<PathBuf>,
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

/// Looks for a failing start.
pub(super) fn run(global: &Global, asked: &FalsifyArguments) -> Result<Outcome> {
    match (&asked.around, &asked.config) {
        (Some(folder), _) => {
            let stored = Stored::read(folder, &global.registry)?;
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
            let target = place(asked, &settings)?;
            Work { global, asked, config: &config, policy: &policy, target }.run(&plant, path)
        }
        (None, None) => {
            Err(Error::invalid("falsify", "give a configuration, or --around a folder"))
        }
    }
}

/// Where starts are looked for that no certificate is about.
fn place(asked: &FalsifyArguments, settings: &Settings) -> Result<Target> {
    let (center, varies) = (settings.state.clone(), settings.growth.varies.clone());
    let (region, words) = match (asked.radius, asked.half_width) {
        (Some(radius), _) => {
            let words = format!("the ball of radius {radius} around the state");
            let radius = positive_f32("--radius", radius)?;
            (Region::Ball(Ball { center, radius, varies }), words)
        }
        (None, Some(half)) => {
            let words = format!("the box of half-width {half} around the state");
            let half = positive_f32("--half-width", half)?;
            let side = |sign: f32| -> Vec<f32> {
                let moved = |(x, varies): (&f32, &bool)| if *varies { x + sign * half } else { *x };
                center.iter().zip(&varies).map(moved).collect()
            };
            (Region::new_box(side(-1.0), side(1.0))?, words)
        }
        (None, None) => (Region::new_box(&*settings.low, &*settings.high)?, "the box".to_owned()),
    };
    Ok(Target { region, words, pairs: None, claim: None })
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
        let listed = asked.starts.iter().cloned();
        inputs(read, policy, networks(config).chain(listed)).spare_folder(&out)?;
        let starts = asked.starts.as_ref().map(|path| {
            let names = plant.model.states.iter().map(|axis| axis.name.clone()).collect();
            StateReader::open(path, names)?.rest()
        });
        let starts = starts.transpose()?;
        let manifest = self.manifest(starts.as_ref())?;
        if global.existing == Existing::Kept {
            is_free(&out, &manifest)?;
        }
        let spec = config.spec()?;
        let settings = FalsifySettings {
            region: target.region.clone(),
            pairs: target.pairs.clone(),
            spec,
            budget: asked.budget,
            seed: config.seed,
        };
        let backend = devices::open(global)?;
        let progress = Progress::new(global);
        let mut staged = Staged::new(&out)?;
        let program = backend.prepare(plant)?;
        let file = starts.map(|starts| roll_out(&program, spec, starts.view(), &progress));
        let file = file.transpose()?;
        let record = falsify(&program, &settings, &progress)?;
        devices::note_events(global, &backend);
        progress.check()?;
        let against = target.claim.as_ref().map(|claim| Against::new(claim, &record));
        let found = Search {
            record: &record,
            file: file.as_ref(),
            within: &target.words,
            against: against.as_ref(),
            fixed: fixed(&plant.model, &target.region),
            provenance: provenance(&program, config.seed, config.to_json()?),
            events: backend.events(),
        };
        stage(&mut staged, plant, &found, &target.region, &manifest)?;
        if global.existing == Existing::Replaced {
            make_way(&out, &manifest)?;
        }
        let files = staged.publish()?;
        report(global, &document(&answer(&found)), || text(plant, &found, &files))?;
        let failed = record.found || file.is_some_and(|file| file.failures > 0);
        Ok(if failed { Outcome::NotObtained } else { Outcome::Done })
    }

    /// What the folder of a search says that it holds.
    fn manifest(&self, starts: Option<&StateList>) -> Result<String> {
        let digest = match self.policy {
            PolicySource::Network { network, .. } => Some(network.digest()),
            PolicySource::Formula(_) => None,
        };
        let mut work = serde_json::json!({
            "config": self.config.to_json()?,
            "policy_sha256": digest,
            "within": self.target.words,
            "budget": self.asked.budget,
        });
        if let Some(starts) = starts {
            let bytes: Vec<u8> = starts.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
            work["starts_sha256"] = sha256([bytes.as_slice()]).into();
        }
        json(MANIFEST, &serde_json::json!({ "falsify": work }))
    }
}
