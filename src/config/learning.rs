//! Training of a plant that is given as text: what stands around its network, and what acts against it.

use std::path::Path;

use toml::{Table, Value};

use super::section::{Config, PolicySection};
use super::sources::UNNAMED;
use super::train::common;
use crate::error::{Error, Result};
use crate::model::text::{Description, Origin};
use crate::model::{Interface, Model};
use crate::rounding::as_written;
use crate::system::Axis;
use crate::train::adam::Optimiser;
use crate::train::contest::Contest;
use crate::train::settings::{AnalyticSettings, TrainSettings, ValueSettings};
use crate::train::unit::{Found, Unit};

/// Name of the network that stands for the one that is to be trained.
const TRAINED: &str = "policy.safetensors";

/// Training for a plant of the user's own: margins in units of what they are at starts.
pub(super) fn described() -> TrainSettings {
    let plain = common(vec![64; 2]);
    TrainSettings {
        held_out: 2048,
        interval: 25,
        patience: 12,
        analytic: AnalyticSettings {
            iterations: 600,
            batch: 128,
            temperature: [0.5, 0.05],
            scale: 1.0,
            certified: 0.0,
            unit: Some(Unit::Found(Found::Margins)),
            stepwise: Some(1.0),
            gamma: Some(1.0),
            optimiser: Optimiser { rate: 4e-3, ..plain.analytic.optimiser },
            ..plain.analytic
        },
        value: ValueSettings { iterations: 4000, states: 50_000, ..plain.value },
        ..plain
    }
}

impl Config {
    /// What stands between the network that is to be trained and the plant.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming a formula that does not fit, or a control without bounds for which no
    /// formula says what it is made of.
    pub fn interface(&self, model: &Model) -> Result<Interface> {
        match self.learner()? {
            Some(description) => description.interface().map_err(|error| self.placed(error)),
            None => Ok(Interface::plain(model)),
        }
    }

    /// The section `policy` of a model as text once its network is the file `file`; none for a system that
    /// the program carries.
    ///
    /// # Errors
    /// Those of [`Self::interface`].
    pub fn trained_policy(&self, file: &str) -> Result<Option<PolicySection>> {
        if self.model.is_none() {
            return Ok(None);
        }
        let act = match &self.policy.act {
            Some(act) => Some(act.clone()),
            None => self.default_act()?,
        };
        let (file, observe) = (Some(file.to_owned()), self.policy.observe.clone());
        Ok(Some(PolicySection { file, formula: None, observe, act }))
    }

    /// The controls from outputs between -1 and 1: none where those are the bounds already.
    fn default_act(&self) -> Result<Option<Table>> {
        let Some(description) = self.with_policy(&PolicySection::default())? else {
            return Ok(None);
        };
        let controls = &description.controls;
        if controls.iter().all(|axis| [axis.low, axis.high] == [-1.0, 1.0]) {
            return Ok(None);
        }
        let formula = |(number, axis): (usize, &Axis)| {
            Ok((axis.name.clone(), Value::String(self.ranged(axis, number)?)))
        };
        controls.iter().enumerate().map(formula).collect::<Result<Table>>().map(Some)
    }

    /// The formula of a control whose range output `number` goes through.
    fn ranged(&self, axis: &Axis, number: usize) -> Result<String> {
        let (low, high) = (as_written(axis.low), as_written(axis.high));
        if !(low.is_finite() && high.is_finite()) {
            let name = &axis.name;
            let problem = format!(
                "open: training needs to know how far `{name}` goes; give finite bounds, or say what it \
                 is made of, for instance `act = {{ {name} = \"5 * out[{number}]\" }}` in [policy], \
                 where the outputs lie between -1 and 1"
            );
            return Err(
                self.placed(Error::invalid(format!("model.controls.{name}.bounds"), problem))
            );
        }
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        Ok(match middle == 0.0 {
            true => format!("{half} * out[{number}]"),
            false => format!("{middle} + {half} * out[{number}]"),
        })
    }

    /// The description with the policy that is to be trained.
    fn learner(&self) -> Result<Option<Description>> {
        match self.trained_policy(TRAINED)? {
            Some(section) => self.with_policy(&section),
            None => Ok(None),
        }
    }

    /// The description of a model as text with `policy` for its section.
    fn with_policy(&self, policy: &PolicySection) -> Result<Option<Description>> {
        let Some(model) = &self.model else { return Ok(None) };
        let origin = Origin::new(UNNAMED, Path::new(""));
        let described = self.description(model, policy, &origin);
        let described = described.map_err(|error| self.placed(error))?;
        Ok(Some(described.with_networks(self.networks.clone())))
    }

    /// The model that is given as text, if there is one.
    pub(super) fn described_model(&self) -> Option<Result<Model>> {
        let description = self.with_policy(&PolicySection::default()).transpose()?;
        Some(description.and_then(|description| description.model()))
    }

    /// What the disturbance of `train.ddpg` does to `model`.
    ///
    /// # Errors
    /// [`Error::Invalid`] where neither the model nor `train.ddpg` has a disturbance, or the latter names
    /// no state.
    pub fn contest(&self, model: &Model) -> Result<Contest> {
        let entries = self.disturbed(&model.states)?;
        let contest = match self.with_policy(&PolicySection::default())? {
            Some(description) => {
                let names = description.disturbances.iter().map(|one| one.name.clone()).collect();
                let step = description.disturbed_step().map_err(|error| self.placed(error))?;
                Contest { step, names }.and_pushing(model, &entries)
            }
            None => Contest::pushing(model, &entries),
        };
        if contest.names.is_empty() {
            return Err(self.placed(Error::invalid("train.ddpg.disturbance", self.undisturbed())));
        }
        Ok(contest)
    }

    /// What to do where nothing disturbs.
    fn undisturbed(&self) -> &'static str {
        match self.model.is_some() {
            true => {
                "no disturbance to train against; give `[model.disturbances]` with `NAME = { bound = 0.3 }` \
                 and use the name in the dynamics, or name a state here"
            }
            false => "empty; name a state, with 0 for a disturbance that does nothing",
        }
    }
}
