//! The settings of training: the `[train]` section of a configuration.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::adam::Optimiser;
use super::unit::Unit;
use crate::error::{Error, Result};
use crate::model::Task;

/// Most rows of a batch, neurons of a layer and layers: more is a slip, and a software adapter cuts
/// sums over twice as many short, without a word.
const MOST: u64 = 1 << 15;
/// Most weights between hidden layers.
const MOST_WEIGHTS: u64 = 1 << 26;
/// Most steps that are remembered: every checkpoint holds them all.
const MOST_REMEMBERED: u64 = 1 << 22;

/// How networks are trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainSettings {
    /// What is trained, and how.
    pub method: Method,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// Where starts are drawn from.
    pub starts: Vec<StartsSection>,
    /// Starts that the network is scored on and never trained on.
    pub held_out: u64,
    /// Iterations between two scores.
    pub interval: u64,
    /// Scores without a better one after which training ends early; 0 for never.
    pub patience: u64,
    /// A policy through the known dynamics.
    pub analytic: AnalyticSettings,
    /// Networks that tell the measure.
    pub value: ValueSettings,
    /// A policy, a disturbance and their critic.
    pub ddpg: DdpgSettings,
    /// A policy on the ordinary reward.
    pub ppo: PpoSettings,
}

/// What is trained, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A policy, by back-propagation of the softened measure through the known dynamics.
    Analytic,
    /// V(x), the measure of the policy's rollout from a state.
    Value,
    /// Q(x, u), the measure after a first control.
    ActionValue,
    /// A policy against a disturbance, both by the critic of the reach-avoid backup.
    Ddpg,
    /// A policy, by proximal policy optimisation on an ordinary reward.
    Ppo,
}

impl Method {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Analytic => "analytic",
            Self::Value => "value",
            Self::ActionValue => "action-value",
            Self::Ddpg => "ddpg",
            Self::Ppo => "ppo",
        }
    }

    /// Refuses a method whose critic knows no time for a task in which steps differ.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the method, the task, and the methods that know every task.
    pub fn check_task(self, task: &Task) -> Result<()> {
        if self != Self::Ddpg || task.is_timeless() {
            return Ok(());
        }
        let problem = format!(
            "the critic of `ddpg` knows no time: it learns `reach-avoid` and `reach` without a window, and \
             `avoid`; this task is `{task}`, and `analytic`, `ppo`, `value` and `action-value` learn any"
        );
        Err(Error::invalid("train.method", problem))
    }

    /// Refuses a model whose periods have `points` parts where the method looks at samples alone.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the method and those that look at the points.
    pub fn check_points(self, points: u32) -> Result<()> {
        if points == 1 || matches!(self, Self::Analytic | Self::Value | Self::ActionValue) {
            return Ok(());
        }
        let (name, kinds) = (self.name(), "`analytic`, `value` and `action-value`");
        let problem = format!(
            "`{name}` looks at samples alone, this task at {} points inside each period (`between`); \
             {kinds} look at them too",
            points - 1
        );
        Err(Error::invalid("train.method", problem))
    }
}

/// A box that starts are drawn from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartsSection {
    /// Its part of all starts, relative to those of the other boxes.
    pub share: f64,
    /// Intervals by state name; other states have those of the configuration's `box`.
    #[serde(rename = "box", default)]
    pub bounds: BTreeMap<String, [f64; 2]>,
}

/// Back-propagation of the softened measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnalyticSettings {
    /// Updates of the network.
    pub iterations: u64,
    /// Starts of each update.
    pub batch: usize,
    /// Temperature of the softened measure at the beginning and at the end; geometric between.
    pub temperature: [f64; 2],
    /// Measure at which a rollout is as good as decided: its gain is `tanh(g / scale)`.
    pub scale: f64,
    /// What a further unit of the scaled measure is worth, so that hopeless starts still pull.
    pub slope: f64,
    /// Weight of the certified measure `V_check` beside G.
    pub certified: f64,
    /// What temperature and scale are multiples of; 1 if nothing is said. With it, policies are compared
    /// by their success, and where that is equal by their mean measure in this unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Weight of the mean over the steps of `tanh(margin / unit)` of what has to hold at each, beside G; for
    /// tasks that have to hold at every step. A rollout that ends badly says little by its worst moment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stepwise: Option<f64>,
    /// Discount of the measure that is trained on, in (0, 1]; that of the rollouts if nothing is said. It
    /// changes no success.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// How the parameters follow their gradients.
    pub optimiser: Optimiser,
}

/// Regression on measures of rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValueSettings {
    /// Updates of the network.
    pub iterations: u64,
    /// States of each update.
    pub batch: usize,
    /// States with their measures.
    pub states: u64,
    /// Share of them that the policy meets on its way, in place of starts.
    pub visited: f64,
    /// How the parameters follow their gradients.
    pub optimiser: Optimiser,
}

/// Min-max DDPG.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DdpgSettings {
    /// Updates of each network.
    pub iterations: u64,
    /// Remembered steps of each update.
    pub batch: usize,
    /// Plants that make one step before each update.
    pub environments: usize,
    /// Steps that are remembered.
    pub replay: usize,
    /// Standard deviation of the noise on what both players do.
    pub noise: f64,
    /// Share of the plants whose players do anything, uniformly, in place of that.
    pub random: f64,
    /// Share by which the slow copies follow at each update.
    pub polyak: f64,
    /// What a full disturbance adds to a state at each step, by state name; beside those of the model.
    pub disturbance: BTreeMap<String, f64>,
    /// How the critic's parameters follow their gradients.
    pub critic: Optimiser,
    /// The same for control and disturbance.
    pub actor: Optimiser,
}

/// Proximal policy optimisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PpoSettings {
    /// Flights of all plants, each followed by updates.
    pub iterations: u64,
    /// Plants.
    pub environments: usize,
    /// Steps that each makes in an iteration.
    pub steps: usize,
    /// Times that the steps of an iteration are learned from.
    pub epochs: u64,
    /// Steps of each update.
    pub batch: usize,
    /// Change of a probability beyond which there is nothing to gain.
    pub clip: f64,
    /// Weight of later temporal differences in an advantage.
    pub lambda: f64,
    /// Weight of the policy's entropy.
    pub entropy: f64,
    /// Standard deviation of each control at first.
    pub spread: f64,
    /// What is rewarded.
    pub reward: RewardSettings,
    /// How parameters follow their gradients.
    pub optimiser: Optimiser,
}

/// The ordinary reward.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RewardSettings {
    /// Where to go, by state name; if nothing is said, toward larger target margins.
    pub goal: BTreeMap<String, f64>,
    /// What a unit of distance toward the goal is worth.
    pub progress: f64,
    /// What entering the target is worth; leaving it costs as much.
    pub target: f64,
    /// What a violation outside of the target costs.
    pub violation: f64,
}

impl TrainSettings {
    /// Refuses numbers out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key.
    pub fn check(&self) -> Result<()> {
        count("train.interval", self.interval, u64::MAX)?;
        count("train.held_out", self.held_out, 1 << 32)?;
        count("train.hidden", self.hidden.len() as u64, 64)?;
        for &width in &self.hidden {
            count("train.hidden", width as u64, MOST)?;
        }
        let weights: u64 = self.hidden.windows(2).map(|pair| (pair[0] * pair[1]) as u64).sum();
        if weights > MOST_WEIGHTS {
            let problem = format!(
                "{weights} weights between hidden layers, at most {MOST_WEIGHTS} are trained: each takes memory \
                 several times over; take narrower layers, or fewer"
            );
            return Err(Error::invalid("train.hidden", problem));
        }
        for part in &self.starts {
            positive("train.starts.share", part.share)?;
        }
        if self.starts.is_empty() {
            return Err(Error::invalid("train.starts", "empty; give one box or more"));
        }
        self.analytic.check()?;
        self.value.check()?;
        self.ddpg.check()?;
        self.ppo.check()
    }
}

impl AnalyticSettings {
    fn check(&self) -> Result<()> {
        count("train.analytic.iterations", self.iterations, u64::MAX)?;
        count("train.analytic.batch", self.batch as u64, MOST)?;
        for temperature in self.temperature {
            positive("train.analytic.temperature", temperature)?;
        }
        positive("train.analytic.scale", self.scale)?;
        not_negative("train.analytic.slope", self.slope)?;
        not_negative("train.analytic.certified", self.certified)?;
        if let Some(Unit::Given(unit)) = self.unit {
            positive("train.analytic.unit", unit)?;
        }
        not_negative("train.analytic.stepwise", self.stepwise.unwrap_or(0.0))?;
        if let Some(gamma) = self.gamma {
            positive("train.analytic.gamma", gamma)?;
            share("train.analytic.gamma", gamma)?;
        }
        optimiser("train.analytic.optimiser", &self.optimiser)
    }
}

impl ValueSettings {
    fn check(&self) -> Result<()> {
        count("train.value.iterations", self.iterations, u64::MAX)?;
        count("train.value.batch", self.batch as u64, MOST)?;
        count("train.value.states", self.states, 1 << 32)?;
        share("train.value.visited", self.visited)?;
        optimiser("train.value.optimiser", &self.optimiser)
    }
}

impl DdpgSettings {
    fn check(&self) -> Result<()> {
        count("train.ddpg.iterations", self.iterations, u64::MAX)?;
        count("train.ddpg.batch", self.batch as u64, MOST)?;
        count("train.ddpg.environments", self.environments as u64, MOST)?;
        count("train.ddpg.replay", self.replay as u64, MOST_REMEMBERED)?;
        not_negative("train.ddpg.noise", self.noise)?;
        share("train.ddpg.random", self.random)?;
        share("train.ddpg.polyak", self.polyak)?;
        for (state, &scale) in &self.disturbance {
            not_negative(&format!("train.ddpg.disturbance.{state}"), scale)?;
        }
        optimiser("train.ddpg.critic", &self.critic)?;
        optimiser("train.ddpg.actor", &self.actor)
    }
}

impl PpoSettings {
    fn check(&self) -> Result<()> {
        count("train.ppo.iterations", self.iterations, u64::MAX)?;
        count("train.ppo.environments", self.environments as u64, MOST)?;
        count("train.ppo.steps", self.steps as u64, MOST)?;
        count("train.ppo.epochs", self.epochs, MOST)?;
        count("train.ppo.batch", self.batch as u64, MOST)?;
        share("train.ppo.clip", self.clip)?;
        share("train.ppo.lambda", self.lambda)?;
        not_negative("train.ppo.entropy", self.entropy)?;
        positive("train.ppo.spread", self.spread)?;
        not_negative("train.ppo.reward.progress", self.reward.progress)?;
        not_negative("train.ppo.reward.target", self.reward.target)?;
        not_negative("train.ppo.reward.violation", self.reward.violation)?;
        optimiser("train.ppo.optimiser", &self.optimiser)
    }
}

/// Refuses what an optimiser cannot work with.
fn optimiser(place: &str, optimiser: &Optimiser) -> Result<()> {
    positive(&format!("{place}.rate"), optimiser.rate)?;
    positive(&format!("{place}.clip"), optimiser.clip)?;
    share(&format!("{place}.last"), optimiser.last)?;
    for decay in optimiser.decays {
        let place = format!("{place}.decays");
        share(&place, decay)?;
        if decay == 1.0 {
            return Err(Error::invalid(place, "1; a mean that never changes"));
        }
    }
    Ok(())
}

fn count(place: &str, value: u64, most: u64) -> Result<()> {
    match (1..=most).contains(&value) {
        true => Ok(()),
        false => Err(Error::invalid(place, format!("{value} is not within 1..={most}"))),
    }
}

fn positive(place: &str, value: f64) -> Result<()> {
    match value.is_finite() && value > 0.0 {
        true => Ok(()),
        false => Err(Error::invalid(place, format!("{value} is not a positive number"))),
    }
}

fn not_negative(place: &str, value: f64) -> Result<()> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(()),
        false => Err(Error::invalid(place, format!("{value} is not a number of 0 or more"))),
    }
}

fn share(place: &str, value: f64) -> Result<()> {
    match (0.0..=1.0).contains(&value) {
        true => Ok(()),
        false => Err(Error::invalid(place, format!("{value} is not within 0 to 1"))),
    }
}
