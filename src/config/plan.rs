//! Plans in closed loop as a configuration asks for them: the section `[plan]`, the model, its costs.

use std::path::{Path, PathBuf};

use super::section::Config;
use super::settings::{finite_interval, in_order};
use super::sources::UNNAMED;
use crate::error::{Error, Result};
use crate::model::text::{Origin, WrittenSource};
use crate::model::{Costs, Model};
use crate::plan::PlanSettings;
use crate::rollout::RolloutSpec;
use crate::scenario::limits::finite;
use crate::system::Axis;

/// What plans need and a text without it is shown.
const EXAMPLE: &str = "\
no costs, and plans are made to cost little; for instance
    [model.costs]
    stage.effort = { weight = 0.1, formula = \"force^2\" }
    terminal.place = { weight = 10.0, formula = \"(x - 1)^2\" }
with the states and controls of the model (docs/models.md)";

impl Config {
    /// The section `[plan]`, every default filled in but those that follow from the model.
    pub fn plan_settings(&self) -> PlanSettings {
        self.plan.clone().unwrap_or_default()
    }

    /// Steps and discount that the runs of plans are judged with.
    ///
    /// # Errors
    /// [`Error::Invalid`] for steps or a discount out of range.
    pub fn plan_spec(&self) -> Result<RolloutSpec> {
        let of_rollout = self.spec()?;
        let steps = self.plan_settings().steps(of_rollout.horizon);
        let spec = RolloutSpec::new(steps, of_rollout.gamma);
        spec.map_err(|error| match error {
            Error::Invalid { problem, .. } => self.placed(Error::invalid("plan.steps", problem)),
            other => other,
        })
    }

    /// The model that plans are made for, whoever else drives it.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a system that the program carries, whose costs are no text, and those of the
    /// description.
    pub fn planned_model(&self) -> Result<Model> {
        let Some(model) = &self.model else { return Err(self.carried()) };
        let origin = Origin::new(UNNAMED, Path::new(""));
        let described = self.description(model, &self.policy, &origin);
        let described = described.map(|found| found.with_networks(self.networks.clone()));
        described.and_then(|found| found.model()).map_err(|error| self.placed(error))
    }

    /// The costs of plans; their files are sought relative to `folder`, where the configuration lies.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a model without costs, with an example of them, and those of
    /// [`Config::costs`].
    pub fn planned_costs(&self, folder: &Path) -> Result<Costs> {
        let missing = || self.placed(Error::invalid("model.costs", EXAMPLE));
        self.costs(folder)?.ok_or_else(missing)
    }

    /// The files of references and maps that the costs name, relative to `folder`.
    ///
    /// # Errors
    /// Those of the description.
    pub fn planned_files(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let Some(model) = &self.model else { return Ok(Vec::new()) };
        let described = self.description(model, &self.policy, &Origin::new(UNNAMED, folder));
        let costs = described.map_err(|error| self.placed(error))?.costs;
        let (references, maps) =
            costs.map_or_else(Default::default, |all| (all.references, all.maps));
        let rows = references.into_iter().filter_map(|reference| match reference.source {
            WrittenSource::File(file) => Some(file),
            WrittenSource::Value(_) | WrittenSource::Formula(_) => None,
        });
        Ok(rows.chain(maps.into_iter().map(|map| map.file)).collect())
    }

    /// The state that a single run starts at, `[states]`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the state whose number is missing or not finite.
    pub fn plan_start(&self, axes: &[Axis]) -> Result<Vec<f32>> {
        in_order("state", &self.state, axes, finite).map_err(|error| self.placed(error))
    }

    /// Ends of the box that starts of several runs are drawn from, `[states]` each.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the state whose interval is missing, turned round or not finite.
    pub fn plan_box(&self, axes: &[Axis]) -> Result<[Vec<f32>; 2]> {
        let intervals = in_order("box", &self.bounds, axes, finite_interval);
        let intervals = intervals.map_err(|error| self.placed(error))?;
        Ok([0, 1].map(|end| intervals.iter().map(|interval| interval[end]).collect()))
    }

    /// The configuration as plans store it, every default filled in, without the sections `race` and
    /// `train`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a value has no JSON form.
    pub fn to_plan_json(&self) -> Result<serde_json::Value> {
        super::stored(Self { train: None, study: None, ..self.clone() })
    }

    /// The refusal of a system that the program carries.
    fn carried(&self) -> Error {
        let problem = "comes with the program, and `plan` is for a model as text with its own \
                       `[model.costs]`: configs/models/double_integrator.toml is an example";
        self.placed(Error::invalid("system.name", problem))
    }
}
