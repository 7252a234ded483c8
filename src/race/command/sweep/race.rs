//! A sweep of races: the same starts and noise seeds at every point.

use std::path::Path;

use super::arguments::SweepArguments;
use super::grid::{Grid, Target, Values};
use crate::backend::{Backend, Program};
use crate::cli::options::Global;
use crate::cli::progress::Progress;
use crate::config::Overrides;
use crate::error::Result;
use crate::files::Existing;
use crate::race::command::input::{RaceInput, RaceStarts, name, noise_seeds};
use crate::race::controller::Name;
use crate::race::run::Experiment;
use crate::race::sweep::record::PointResult;
use crate::race::sweep::{Computed, Store};
use crate::scenario::Watch;

/// What every point has.
struct Sweep<'a> {
    config: &'a Path,
    base: Overrides,
    grid: &'a Grid,
    backend: &'a Backend,
    out: &'a Path,
    starts: Vec<[f32; 12]>,
    source: String,
    noise_seeds: Vec<u64>,
}

/// Races every point that is not stored yet.
pub(super) fn run(
    global: &Global,
    asked: &SweepArguments,
    grid: &Grid,
    backend: &Backend,
    progress: &Progress,
    out: &Path,
) -> Result<Store> {
    let base = global.overrides();
    let input = RaceInput::load(&asked.config, &base)?;
    let RaceStarts { states: starts, source } = input.starts(asked.race.starts.as_deref())?;
    input.inputs(&asked.config, asked.race.starts.as_deref()).spare_folder(out)?;
    let noise_seeds = noise_seeds(input.config.seed, asked.race.noise_seeds.unwrap_or(1))?;
    let config = asked.config.as_path();
    let sweep = Sweep { config, base, grid, backend, out, starts, source, noise_seeds };
    let points = grid.points();
    // All of them before the first race: a grid does not end half-way at a value out of range.
    let hashes =
        points.iter().map(|values| sweep.checked(values)).collect::<Result<Vec<String>>>()?;
    let plant = input.plant()?;
    let program = backend.prepare(&plant)?;
    let shared = sweep.experiment(&input, &program)?;
    let record = shared.sweep(grid.records(), points.len() as u64);
    let identity = shared.sweep_identity();
    if global.existing == Existing::Replaced {
        Store::make_way(out, &identity, &record)?;
    }
    let mut store = Store::open(out, &identity, record)?;
    let total = points.len();
    for (i, (values, sha256)) in points.into_iter().zip(hashes).enumerate() {
        let label = grid.label(i, total, &values);
        store.point(sha256, values.clone(), || {
            let result = sweep.race(&values, &label, progress)?;
            Ok(Computed { result, events: backend.events() })
        })?;
    }
    Ok(store)
}

impl Sweep<'_> {
    /// The controller of a point.
    fn controller(&self, values: &Values) -> Result<Name> {
        name(self.grid.value(values, &Target::Controller).unwrap_or_default())
    }

    /// The configuration of a point.
    fn input(&self, values: &Values) -> Result<RaceInput> {
        let controller = Some(self.controller(values)?);
        let overrides = self.grid.overrides(&self.base, values, controller)?;
        let input = RaceInput::load(self.config, &overrides);
        input.map_err(|error| self.grid.blamed(error, values))
    }

    /// The races of a point.
    fn experiment<'a>(
        &'a self,
        input: &'a RaceInput,
        program: &'a Program<'a>,
    ) -> Result<Experiment<'a>> {
        Ok(Experiment {
            world: input.world(self.backend, program)?,
            names: Vec::new(),
            starts: self.starts.clone(),
            source: self.source.clone(),
            noise_seeds: self.noise_seeds.clone(),
            config: input.config.to_json()?,
            folder: self.out.to_owned(),
        })
    }

    /// SHA-256 of a point that can be raced.
    fn checked(&self, values: &Values) -> Result<String> {
        let name = self.controller(values)?;
        let input = self.input(values)?;
        let plant = input.plant()?;
        let program = self.backend.prepare(&plant)?;
        let experiment = self.experiment(&input, &program)?;
        let checked = experiment.check_point(name);
        checked.map_err(|error| self.grid.blamed(input.config.placed(error), values))?;
        Ok(experiment.point_sha256(name))
    }

    /// Races a point.
    fn race(&self, values: &Values, label: &str, progress: &Progress) -> Result<PointResult> {
        let name = self.controller(values)?;
        let input = self.input(values)?;
        let plant = input.plant()?;
        let program = self.backend.prepare(&plant)?;
        let experiment = self.experiment(&input, &program)?;
        let races = self.starts.len() * self.noise_seeds.len();
        progress.begin(label, races as u64 * u64::from(experiment.world.race.steps));
        experiment.point(name, progress).map(PointResult::Race)
    }
}
