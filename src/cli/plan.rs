//! The command `plan`: a model steered in closed loop by plans, what came of it, and its pictures.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::options::Global;
use super::planned::{Steered, stage, text};
use super::progress::Progress;
use super::{Outcome, caveats, devices, folder_of, report};
use crate::backend::Backend;
use crate::config::{Config, PolicySource};
use crate::digest::sha256;
use crate::error::Result;
use crate::files::{Existing, Inputs, MANIFEST, Staged, check_room, is_free, json, make_way};
use crate::model::{Costs, Model, Plant};
use crate::plan::settings::FirstPlan;
use crate::plan::{ClosedLoop, FirstPlans, Judged, PlanSettings, Setting, costs_sha256, starts};
use crate::rollout::RolloutSpec;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-plan";
/// Bytes of a number in the table of steps, about.
const CELL: u64 = 20;

/// Steers the model of the configuration at `path`.
pub(super) fn run(global: &Global, path: &Path) -> Result<Outcome> {
    let config = Config::load(path, &global.overrides())?;
    let asked = Asked::read(&config, path)?;
    let out = global.folder(DEFAULT_OUT);
    asked.inputs(path).spare_folder(&out)?;
    let manifest = asked.manifest()?;
    if global.existing == Existing::Kept {
        is_free(&out, &manifest)?;
    }
    let backend = devices::open(global)?;
    let progress = Progress::new(global);
    // Before the work: a folder that cannot be written to would waste it.
    let mut staged = Staged::new(&out)?;
    check_room(&out, asked.estimate())?;
    let told = caveats::undisturbed(&config).into_iter();
    caveats::tell(global, told);
    let steered = asked.steer(&backend, &progress)?;
    devices::note_events(global, &backend);
    progress.check()?;
    staged.add(MANIFEST, manifest.as_bytes())?;
    stage(&mut staged, &asked.model, &asked.costs, &steered)?;
    if global.existing == Existing::Replaced {
        make_way(&out, &manifest)?;
    }
    let files = staged.publish()?;
    report(global, &steered.record, || text(&steered.record, &files))?;
    Ok(Outcome::Done)
}

/// What a configuration asks for.
struct Asked<'a> {
    config: &'a Config,
    model: Arc<Model>,
    costs: Costs,
    /// Files of references and maps.
    files: Vec<PathBuf>,
    /// The policy that first plans are rollouts of.
    policy: Option<Steering>,
    settings: PlanSettings,
    spec: RolloutSpec,
    state: Vec<f32>,
    bounds: [Vec<f32>; 2],
}

/// A policy, and where it came from.
struct Steering {
    source: PolicySource,
    plant: Plant,
}

impl Steering {
    /// The policy of `config`, which lies in `folder`, where first plans are rollouts of it.
    fn read(config: &Config, folder: &Path, first: FirstPlan) -> Result<Option<Self>> {
        match first {
            FirstPlan::Middle => Ok(None),
            FirstPlan::Policy => {
                let source = config.policy_source(folder)?;
                Ok(Some(Self { plant: config.plant(&source)?, source }))
            }
        }
    }
}

impl<'a> Asked<'a> {
    /// Reads what `config`, the configuration at `path`, asks for.
    fn read(config: &'a Config, path: &Path) -> Result<Self> {
        let (folder, settings) = (folder_of(path), config.plan_settings());
        let model = config.planned_model()?;
        let (costs, files) = (config.planned_costs(&model, folder)?, config.planned_files(folder)?);
        let spec = config.plan_spec()?;
        model.task.check(spec.horizon).map_err(|error| config.placed(error))?;
        settings.spec(&model.controls).map_err(|error| config.placed(error))?;
        let policy = Steering::read(config, folder, settings.first_plan)?;
        let (state, bounds) = (config.plan_start(&model.states)?, config.plan_box(&model.states)?);
        Ok(Self {
            config,
            model: Arc::new(model),
            costs,
            files,
            policy,
            settings,
            spec,
            state,
            bounds,
        })
    }

    /// The files that are read.
    fn inputs(&self, path: &Path) -> Inputs {
        let network = self.policy.as_ref().and_then(|steering| match &steering.source {
            PolicySource::Network { path, .. } => Some(path.clone()),
            PolicySource::Formula(_) => None,
        });
        let called = self.config.networks.iter().map(|file| file.path.clone());
        let own = [path.to_owned()].into_iter().chain(self.files.iter().cloned());
        Inputs::new(own.chain(network).chain(called))
    }

    /// What the folder says that it holds.
    fn manifest(&self) -> Result<String> {
        let network = self.policy.as_ref().and_then(|steering| match &steering.source {
            PolicySource::Network { network, .. } => Some(network.digest()),
            PolicySource::Formula(_) => None,
        });
        let work = serde_json::json!({
            "config": self.config.to_plan_json()?,
            "policy_sha256": network,
            "model_sha256": sha256([self.model.text().as_bytes()]),
            "costs_sha256": costs_sha256(&self.costs),
        });
        json(MANIFEST, &serde_json::json!({ "plan": work }))
    }

    /// About what the files of the folder take, bytes.
    fn estimate(&self) -> u64 {
        let columns = self.model.states.len() + self.model.controls.len() + self.costs.terms.len();
        let rows = u64::from(self.settings.runs) * u64::from(self.spec.horizon + 1);
        (1 << 20) + 2 * CELL * rows * (columns as u64 + 8)
    }

    /// Steers all runs to their end.
    fn steer(&self, backend: &Backend, progress: &Progress) -> Result<Steered> {
        let placed = |error| self.config.placed(error);
        let (seed, settings) = (self.config.seed, &self.settings);
        let starts = starts(seed, settings.runs, &self.state, &self.bounds).map_err(placed)?;
        let closed_loop = ClosedLoop::new(backend, &self.model, &self.costs, settings, seed);
        let closed_loop = closed_loop.map_err(placed)?;
        let first = match &self.policy {
            Some(steering) => FirstPlans::Policy(&steering.plant),
            None => FirstPlans::Middle,
        };
        let flown = closed_loop.run(&starts, self.spec.horizon, first, progress).map_err(placed)?;
        let judge = |run| Judged::new(&self.model, run, &self.spec);
        let judged: Vec<Judged> = flown.runs.iter().map(judge).collect();
        let setting = Setting {
            backend,
            model: &self.model,
            costs: &self.costs,
            settings,
            spec: self.spec,
            bounds: self.bounds.clone(),
            seed,
            config: self.config.to_plan_json()?,
        };
        let record = setting.record(&closed_loop, &flown, &judged);
        Ok(Steered { record, flown, judged, bounds: setting.bounds })
    }
}
