//! A whole experiment: every controller with every noise seed, batch by batch, resumed where it
//! stopped.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::controller::plan::Paths;
use super::controller::roster::{absent, certifies, controller, settings, values};
use super::controller::{Name, World};
use super::flight::{STEP_SECONDS, fly, race_seed};
use super::folder::{RACES, batch_file, events_of, store, stored};
use super::judge::{Judge, safe_at_start};
use super::log::{RaceLog, arrays};
use super::picture::picture;
use super::record::{
    AbsentRecord, BoundsRecord, CeilingRecord, PictureRecord, RACE_SCHEMA, RaceRecord, StartsRecord,
};
use super::settings::RaceSettings;
use super::summary::Summary;
use super::timing::TimingRecord;
use super::weights::{note, sample_steps};
use crate::backend::{Event, add_events};
use crate::control::tier::{Asked, Certifier, Domain};
use crate::digest;
use crate::error::{Error, Result};
use crate::files::{ARCHIVE_BYTES, Claim, Staged, make_way, read, read_text};
use crate::policy::Mlp;
use crate::rollout::States;
use crate::scenario::sampling::sampling;
use crate::scenario::settings::Joint;
use crate::scenario::{Tightened, Unwatched, Watch, provenance};

/// Races of a batch; what is lost when the program is stopped is at most one of them.
pub(super) const BATCH: usize = 512;
/// Random streams of one purpose that a race has.
const MOST_STREAMS: u64 = 1 << 24;
/// Most steps of samples: a year of a few cores, or weeks of a GPU.
const MOST_SAMPLE_STEPS: f64 = 1e16;
/// Starts whose rollouts under the policy are looked at for what samples do not tell.
const LOOKED_AT: usize = 16;
/// Room for record, page and manifest, bytes.
const RECORD_BYTES: u64 = 2 << 20;

/// What is to be raced.
#[derive(Clone)]
pub struct Experiment<'a> {
    /// What controllers are made of.
    pub world: World<'a>,
    /// The controllers.
    pub names: Vec<Name>,
    /// The starts.
    pub starts: Vec<[f32; 12]>,
    /// Where they come from, in words.
    pub source: String,
    /// The noise seeds.
    pub noise_seeds: Vec<u64>,
    /// The configuration, as it is stored.
    pub config: serde_json::Value,
    /// Where races are stored as they come.
    pub folder: PathBuf,
}

/// What an experiment came to.
#[derive(Clone, Debug)]
pub struct RaceResults {
    /// The record, the same of every run.
    pub record: RaceRecord,
    /// The compute time of each controller, in this run.
    pub timings: Vec<TimingRecord>,
}

impl Experiment<'_> {
    /// Removes the results of other work from the folder, once nothing is wrong with this.
    ///
    /// # Errors
    /// Those of [`Experiment::run`] before any race.
    pub fn make_way(&self) -> Result<()> {
        self.check(&[])?;
        make_way(&self.folder, &format!("{:#}\n", self.manifest()))
    }

    /// Runs what is not stored yet and makes the record of all.
    ///
    /// # Errors
    /// Those of [`RaceSettings::check`] and of the
    /// controllers, before any race; [`Error::Write`] or [`Error::NoRoom`] before any race if its
    /// folder does not take the results; [`Error::File`] if the folder holds another experiment or a
    /// stored race is damaged; [`Error::Interrupted`].
    pub fn run(&self, watch: &dyn Watch) -> Result<RaceResults> {
        let reason = |name: &Name| absent(*name, &self.world).map(|reason| (*name, reason));
        let absent: Vec<(Name, String)> = self.names.iter().filter_map(reason).collect();
        let runs = |name: &Name| !absent.iter().any(|(missing, _)| missing == name);
        let names: Vec<Name> = self.names.iter().copied().filter(runs).collect();
        self.check(&names)?;
        let manifest = format!("{:#}\n", self.manifest());
        let mut claim = Claim::new(&self.folder, &manifest, self.need(&names))?;
        Staged::within(&self.folder, RACES)?;
        let (mut summaries, mut timings) = (Vec::new(), Vec::new());
        for name in names {
            let mut summary = self.controller(name, watch)?;
            timings.push(TimingRecord::new(name, std::mem::take(&mut summary.seconds)));
            summaries.push((name, summary));
        }
        let record = self.record(&summaries, absent, watch)?;
        claim.keep();
        Ok(RaceResults { record, timings })
    }

    /// Refuses what would fail later: nothing to race, numbers out of range, and settings that a
    /// controller does not take.
    pub(super) fn check(&self, names: &[Name]) -> Result<()> {
        for (place, empty) in
            [("starts", self.starts.is_empty()), ("noise seeds", self.noise_seeds.is_empty())]
        {
            if empty {
                return Err(Error::invalid(place, "none; give at least one"));
            }
        }
        let race = self.world.race;
        race.check(self.world.system)?;
        let growth = &self.world.certificates.growth;
        let (calls, rounds) = (u64::from(race.steps), u64::from(growth.rounds));
        if calls * rounds >= MOST_STREAMS {
            let problem = format!(
                "{rounds} rounds at each of {calls} steps (race.steps) take more than the \
                 {MOST_STREAMS} random streams that there are"
            );
            return Err(Error::invalid("growth.rounds", problem));
        }
        let work = self.sample_steps(names);
        if work > MOST_SAMPLE_STEPS {
            let problem = format!(
                "the plans would roll out up to {work:.1e} steps of samples, at most \
                 {MOST_SAMPLE_STEPS:.0e}; fewer `samples`, `iterations`, steps, starts or noise seeds \
                 take less"
            );
            return Err(Error::invalid("race", problem));
        }
        for &name in names {
            let race = settings(name, race);
            controller(name, World { race: &race, ..self.world }, 1, Paths::None)?;
        }
        Ok(())
    }

    /// Steps of samples that the plans of the controllers `names` roll out in all races, at most.
    pub fn sample_steps(&self, names: &[Name]) -> f64 {
        let race = self.world.race;
        let races = self.starts.len() as f64 * self.noise_seeds.len() as f64;
        let each = names.iter().map(|&name| sample_steps(name, &settings(name, race)));
        races * f64::from(race.steps) * each.sum::<f64>()
    }

    /// Room that the races take which are still to be flown, with the results of all, bytes.
    fn need(&self, names: &[Name]) -> u64 {
        let races = self.folder.join(RACES);
        let mut missing = 0;
        for &name in names {
            for &seed in &self.noise_seeds {
                for first in (0..self.starts.len()).step_by(BATCH) {
                    if !races.join(batch_file(name, seed, first)).exists() {
                        missing += BATCH.min(self.starts.len() - first) as u64;
                    }
                }
            }
        }
        let race = arrays(&[RaceLog::default()], self.world.race.steps as usize);
        let bytes: usize = race.iter().map(|(_, array)| array.data.bytes()).sum();
        missing * bytes as u64 + RECORD_BYTES
    }

    /// All races of one controller.
    fn controller(&self, name: Name, watch: &dyn Watch) -> Result<Summary> {
        let race = settings(name, self.world.race);
        let world = World { race: &race, ..self.world };
        let betas = self.betas(name, &race);
        let mut summary = Summary::new(name, race.judge, race.steps, betas);
        for &noise_seed in &self.noise_seeds {
            summary.next_seed();
            let total = self.starts.len() as u64 * u64::from(race.steps);
            watch.begin(&format!("{}, noise seed {noise_seed}", name.text()), total);
            for first in (0..self.starts.len()).step_by(BATCH) {
                summary.add(&self.batch(name, world, noise_seed, first, watch)?);
            }
        }
        Ok(summary)
    }

    /// What the deviation bound and one call of growth of the controller `name` spend.
    fn betas(&self, name: Name, race: &RaceSettings) -> [f64; 2] {
        let certificates = self.world.certificates;
        if !certifies(name) {
            return [0.0; 2];
        }
        let deviation = &certificates.deviation;
        // Bounds of each step on its own hold together at the sum of their betas.
        let steps = match deviation.joint {
            Joint::Separate => f64::from(certificates.spec.horizon),
            _ => 1.0,
        };
        let call = if race.hybrid.local { certificates.growth.call_beta() } else { 0.0 };
        // Tier 1 by margin drops rests on the sequence that chose its set.
        let first = match certificates.drops {
            Some(_) => certificates.global.beta,
            None => steps * deviation.beta,
        };
        [first, call]
    }

    /// The races from `first` on: stored ones, or flown now and stored.
    fn batch(
        &self,
        name: Name,
        world: World<'_>,
        noise_seed: u64,
        first: usize,
        watch: &dyn Watch,
    ) -> Result<Vec<RaceLog>> {
        let starts = &self.starts[first..self.starts.len().min(first + BATCH)];
        let steps = world.race.steps;
        let file = batch_file(name, noise_seed, first);
        let path = self.folder.join(RACES).join(&file);
        let label = format!("{file} {}", self.manifest());
        if path.exists() {
            watch.advance(starts.len() as u64 * u64::from(steps))?;
            return stored(&path, starts, steps, &label);
        }
        let seeds = self.seeds(noise_seed, first, starts.len());
        let logs = flown(name, world, starts, &seeds, watch)?;
        store(&self.folder, &file, &logs, steps, &label, &world.backend.events())?;
        Ok(logs)
    }

    /// The seeds of the races `first..first + count`.
    pub(super) fn seeds(&self, noise_seed: u64, first: usize, count: usize) -> Vec<u64> {
        (first..first + count).map(|race| race_seed(noise_seed, race as u64)).collect()
    }

    /// The record of all that ran.
    fn record(
        &self,
        summaries: &[(Name, Summary)],
        absent: Vec<(Name, String)>,
        watch: &dyn Watch,
    ) -> Result<RaceRecord> {
        let World { program, value, disturbance, ppo, race, certificates, .. } = self.world;
        let hybrid = summaries.iter().find(|(name, _)| *name == Name::Hybrid);
        let hybrid = hybrid.map(|(_, summary)| summary);
        let absent = absent
            .into_iter()
            .map(|(name, reason)| AbsentRecord { name: name.text().to_owned(), reason });
        let controllers = summaries.iter().map(|(_, summary)| summary.record(hybrid));
        let shown = match hybrid {
            Some(_) => self.picture(Name::Hybrid, watch)?,
            None => None,
        };
        let ran: Vec<Name> = summaries.iter().map(|(name, _)| *name).collect();
        let value = value.filter(|_| ran.iter().any(|name| values(*name, race)));
        let tiered = ran.iter().any(|name| certifies(*name));
        let ppo = ppo.filter(|_| ran.contains(&Name::PpoCbf));
        let disturbance = disturbance.filter(|_| tiered);
        Ok(RaceRecord {
            schema: RACE_SCHEMA,
            provenance: provenance(program, certificates.seed, self.config.clone()),
            value_sha256: value.map(Mlp::digest),
            disturbance_sha256: disturbance.map(Mlp::digest),
            ppo_sha256: ppo.map(Mlp::digest),
            bounds: if tiered { Some(self.bounds()?) } else { None },
            steps: race.steps,
            step_seconds: STEP_SECONDS,
            starts: self.starts_record(),
            noise_seeds: self.noise_seeds.clone(),
            controllers: controllers.collect(),
            absent: absent.collect(),
            picture: shown,
            events: self.events(&ran)?,
            notes: self.notes(summaries),
        })
    }

    /// What has to be said beside the figures: of states at samples, and of plans whose weights say
    /// little.
    fn notes(&self, summaries: &[(Name, Summary)]) -> Vec<String> {
        let World { program, race, certificates, .. } = self.world;
        let few = &self.starts[..self.starts.len().min(LOOKED_AT)];
        let mut notes = sampling(program.plant(), States::from(few), certificates.spec.horizon);
        notes.extend(summaries.iter().filter_map(|(name, summary)| {
            note(*name, &settings(*name, race), summary.plan_means())
        }));
        notes
    }

    /// What failed on the adapter, in this run and in those that stored races of `names` before it.
    fn events(&self, names: &[Name]) -> Result<Vec<Event>> {
        let mut all = Vec::new();
        for name in names {
            for &noise_seed in &self.noise_seeds {
                for first in (0..self.starts.len()).step_by(BATCH) {
                    let file = events_of(&batch_file(*name, noise_seed, first));
                    let path = self.folder.join(RACES).join(file);
                    if path.exists() {
                        add_events(&mut all, stored_events(&path)?);
                    }
                }
            }
        }
        add_events(&mut all, self.world.backend.events());
        Ok(all)
    }

    /// What V_check is computed with.
    fn bounds(&self) -> Result<BoundsRecord> {
        let World { program, certificates, .. } = self.world;
        let asked = Asked { global: true, local: false, domain: Domain::Anywhere };
        let certifier = Certifier::new(program, certificates, asked)?;
        let Tightened { constants, deviation, drops, .. } = certifier.tightened().clone();
        let (sequence, band) = (certifier.sequence().cloned(), certifier.band());
        Ok(BoundsRecord { constants, deviation, drops, sequence, band })
    }

    /// The race that is drawn: of the first batch with the first noise seed, the first of those
    /// that saw the most tiers. None if it did not come out as it is stored, which says that the
    /// device does not give the same bits twice.
    fn picture(&self, name: Name, watch: &dyn Watch) -> Result<Option<PictureRecord>> {
        let race = settings(name, self.world.race);
        let world = World { race: &race, ..self.world };
        let noise_seed = self.noise_seeds[0];
        let logs = self.batch(name, world, noise_seed, 0, &Unwatched)?;
        let seen = |race: &RaceLog| {
            let mut tiers: Vec<_> = race.steps.iter().map(|step| step.tier).collect();
            tiers.sort_unstable();
            tiers.dedup();
            tiers.len()
        };
        let most = logs.iter().map(seen).max().unwrap_or(0);
        let start = logs.iter().position(|race| seen(race) == most).unwrap_or(0);
        let seed = race_seed(noise_seed, start as u64);
        let shown = picture(name, world, start, self.starts[start], noise_seed, seed, watch)?;
        let flown = shown.frames.iter().map(|frame| frame.x.as_slice());
        let same = flown.eq(logs[start].states.iter().map(|x| x.as_slice()));
        Ok(same.then_some(shown))
    }

    /// The starts in words and figures.
    pub(super) fn starts_record(&self) -> StartsRecord {
        StartsRecord {
            source: self.source.clone(),
            count: self.starts.len() as u64,
            sha256: self.starts_sha256(),
            ceilings: Judge::ALL.map(|judge| self.ceiling(judge)).to_vec(),
        }
    }

    /// Starts that do not violate `judge` before anyone moves.
    fn ceiling(&self, judge: Judge) -> CeilingRecord {
        let safe = self.starts.iter().filter(|start| safe_at_start(judge, start)).count();
        CeilingRecord { judge, safe: safe as u64 }
    }

    /// SHA-256 over the starts.
    fn starts_sha256(&self) -> String {
        digest::sha256([bytemuck::cast_slice(&self.starts)])
    }

    /// Everything that the races depend on but their controller and noise seed, the program included.
    pub(super) fn manifest(&self) -> serde_json::Value {
        let World { program, value, disturbance, ppo, certificates, .. } = self.world;
        let digest = |network: Option<&Mlp>| network.map(Mlp::digest);
        let origin = provenance(program, certificates.seed, self.config.clone());
        serde_json::json!({
            "schema": RACE_SCHEMA,
            "program_sha256": program_sha256(),
            "provenance": origin,
            "starts_sha256": self.starts_sha256(),
            "value_sha256": digest(value),
            "disturbance_sha256": digest(disturbance),
            "ppo_sha256": digest(ppo),
        })
    }
}

/// What failed on an adapter while stored races were flown, as the file at `path` tells it.
fn stored_events(path: &Path) -> Result<Vec<Event>> {
    let damaged = |problem: &dyn std::fmt::Display| {
        let remedy = "remove the file, and what failed on the adapter then is told no more";
        Error::file(path, format!("{problem}; {remedy}"))
    };
    let text = read_text(path, ARCHIVE_BYTES).map_err(|error| damaged(&error))?;
    serde_json::from_str(&text).map_err(|error| damaged(&error))
}

/// SHA-256 of the program that runs.
pub(super) fn program_sha256() -> &'static str {
    static DIGEST: OnceLock<String> = OnceLock::new();
    DIGEST.get_or_init(|| {
        let read = |path: PathBuf| read(&path, ARCHIVE_BYTES);
        let program = std::env::current_exe().and_then(read);
        program.map_or_else(|_| "unknown".to_owned(), |bytes| digest::sha256([&bytes[..]]))
    })
}

/// The races of the controller `name` from `starts`, with the settings of the controller in `world`.
pub(super) fn flown(
    name: Name,
    world: World<'_>,
    starts: &[[f32; 12]],
    seeds: &[u64],
    watch: &dyn Watch,
) -> Result<Vec<RaceLog>> {
    let mut controller = controller(name, world, starts.len(), Paths::None)?;
    let steps = world.race.steps;
    let flights = fly(controller.as_mut(), world.system, starts, seeds, steps, watch)?;
    Ok(flights.iter().map(RaceLog::from).collect())
}
