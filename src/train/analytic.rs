//! A policy by back-propagation of the softened measure through the known dynamics.

use std::sync::Arc;

use burn_tensor::Tensor;

use super::adam::Adam;
use super::device::{self, Device};
use super::network::{Bound, Network};
use super::physics::apply;
use super::purpose;
use super::rows::Rows;
use super::run::Learner;
use super::score::{mean_measure, share, successes};
use super::settings::AnalyticSettings;
use super::soft::{Measured, further_tapes, measure_tape, observe_tape, step_tape};
use super::starts::Mixture;
use super::tape::Tape;
use crate::backend::Backend;
use crate::error::{Error, Result};
use crate::model::{Interface, Model, Role};
use crate::policy::Mlp;
use crate::rollout::{RolloutSpec, StateList, States, Tightening};
use crate::rounding::number;

/// Weights of the last layer at first, as a share of the others': no output is near saturation.
pub const LAST: f32 = 0.1;

/// Most numbers that the way back may keep, 4 GiB: beyond that a machine swaps or the training is killed.
const MOST_KEPT: u64 = 1 << 30;

/// What is trained, on what.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The plant.
    pub model: Arc<Model>,
    /// What stands between the policy's network and the plant.
    pub interface: Interface,
    /// Who runs the rollouts that the policy is scored by.
    pub backend: &'a Backend,
    /// Where its tensors lie.
    pub device: Device,
    /// Length and discount of a rollout.
    pub spec: RolloutSpec,
    /// What the margins lose in `V_check`; none if it has no part in the objective.
    pub tightening: Option<Tightening>,
    /// Where starts are drawn from.
    pub mixture: Mixture,
    /// Starts that the policy is scored on.
    pub held_out: u64,
    /// Seed of every stream.
    pub seed: u64,
}

/// A policy under training.
#[derive(Debug)]
pub struct Analytic<'a> {
    task: Task<'a>,
    settings: AnalyticSettings,
    /// The first part of a step.
    step: Arc<Tape>,
    /// The parts behind it, where a period has several.
    further: Vec<Arc<Tape>>,
    observe: Option<Arc<Tape>>,
    /// What temperature and scale are multiples of.
    unit: f64,
    measure: Arc<Tape>,
    network: Network,
    adam: Adam,
    held_out: StateList,
}

impl Task<'_> {
    /// Names of the inputs of the policy's network, where they are states.
    pub(super) fn order(&self) -> Option<Vec<String>> {
        self.interface.order(&self.model)
    }

    /// What the policy's network sees of `states`, and the states, as tensors of a row each.
    pub(super) fn seen(&self, states: States<'_>) -> [Tensor<2>; 2] {
        let rows = |numbers: Vec<f32>| {
            let columns = numbers.len() / states.len();
            self.device.tensor(numbers, [states.len(), columns])
        };
        let seen = Rows::new(&self.model, states.numbers()).seen(&self.interface);
        [rows(seen), rows(states.numbers().to_vec())]
    }

    /// Refuses formulas around the network that read the time, for what is learned of states alone.
    ///
    /// # Errors
    /// [`Error::Invalid`] saying so.
    pub(super) fn check_interface(&self) -> Result<()> {
        if self.interface.is_stationary(&self.model) {
            return Ok(());
        }
        let problem = "`observe` or `act` reads the time; train with `analytic` or `ppo`, which know at \
                       which step a state is met";
        Err(Error::invalid("policy", problem))
    }

    /// Refuses a `batch` of rollouts that keep more for the way back than there is room for.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the numbers kept, of the states and of a network with these `hidden` layers.
    pub fn check_room(&self, hidden: &[usize], batch: usize) -> Result<()> {
        let looks = self.model.looks(self.spec.horizon) as u64;
        let row = hidden.iter().sum::<usize>() + self.interface.outputs + self.model.states.len();
        let kept = looks.saturating_mul(row as u64).saturating_mul(batch as u64);
        if kept <= MOST_KEPT {
            return Ok(());
        }
        let problem = format!(
            "{batch} rollouts of {looks} states keep {kept} numbers for the way back, at most {MOST_KEPT}; take \
             a smaller batch or a shorter `horizon`"
        );
        Err(Error::invalid("train.analytic.batch", problem))
    }

    /// Whether each of `starts` succeeds under `network`.
    pub(super) fn succeeds(
        &self,
        network: impl Into<Arc<Mlp>>,
        starts: States<'_>,
    ) -> Result<Vec<bool>> {
        let plant = self.interface.plant(&self.model, network);
        successes(self.backend, &plant, self.spec, starts)
    }
}

impl<'a> Analytic<'a> {
    /// Trains `network` from the parameters that it has.
    pub fn new(task: Task<'a>, network: Network, settings: AnalyticSettings) -> Self {
        let held_out = task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize);
        let unit = settings.unit.map_or(1.0, |unit| unit.number(&task.model, &held_out));
        let measured = Measured {
            spec: &task.spec,
            tightening: task.tightening.as_ref(),
            unit: stepwise(&task, &settings).map(|_| unit as f32),
        };
        Self {
            unit,
            step: Arc::new(step_tape(&task.model, &task.interface)),
            further: further_tapes(&task.model, &task.interface)
                .into_iter()
                .map(Arc::new)
                .collect(),
            observe: observe_tape(&task.model, &task.interface).map(Arc::new),
            measure: Arc::new(measure_tape(&task.model, measured)),
            adam: Adam::new(network.parameters.len()),
            network,
            held_out,
            task,
            settings,
        }
    }

    /// The softened measures `[starts, 1 to 3]` of rollouts under `network`: G, `V_check` and the mean over
    /// the steps, as far as they have a weight.
    pub fn measures(&self, network: &Bound, starts: States<'_>, temperature: f32) -> Tensor<2> {
        let (device, count) = (&self.task.device, starts.len());
        let mut x = device.tensor(starts.numbers().to_vec(), [count, starts.size()]);
        let mut states = vec![x.clone()];
        for step in 0..self.task.spec.horizon {
            let step = device.tensor(vec![step as f32; count], [count, 1]);
            let seen = match &self.observe {
                Some(observe) => apply(observe, temperature, [x.clone(), step.clone()]),
                None => x.clone(),
            };
            let out = network.forward(seen);
            let sample = x.clone();
            x = apply(&self.step, temperature, [x, out.clone(), step.clone()]);
            states.push(x.clone());
            for part in &self.further {
                x = apply(part, temperature, [x, sample.clone(), out.clone(), step.clone()]);
                states.push(x.clone());
            }
        }
        apply(&self.measure, temperature, [Tensor::cat(states, 1)])
    }

    /// Mean gain `tanh(g / scale) + slope g / scale` of the measures, the certified one weighted, and with
    /// it the weighted mean over the steps.
    fn gain(&self, measures: Tensor<2>) -> Tensor<1> {
        let Some(weight) = stepwise(&self.task, &self.settings) else {
            return self.gain_of(measures);
        };
        let [_, columns] = measures.dims();
        let steps = measures.clone().narrow(1, columns - 1, 1).mean().mul_scalar(weight);
        self.gain_of(measures.narrow(1, 0, columns - 1)) + steps
    }

    /// The same of G and `V_check` alone.
    fn gain_of(&self, measures: Tensor<2>) -> Tensor<1> {
        let AnalyticSettings { scale, slope, certified, .. } = self.settings;
        let [rows, columns] = measures.dims();
        let scaled = measures.div_scalar(scale * self.unit);
        let gains = scaled.clone().tanh() + scaled.mul_scalar(slope);
        let weights = [1.0, certified as f32][..columns].to_vec();
        (gains * self.task.device.tensor(weights, [1, columns])).sum().div_scalar(rows as f64)
    }

    /// The temperature of an iteration.
    fn temperature(&self, iteration: u64) -> f32 {
        let AnalyticSettings { temperature: [first, last], iterations, .. } = self.settings;
        let share = iteration as f64 / (iterations.max(2) - 1) as f64;
        (self.unit * first * (last / first).powf(share)) as f32
    }

    /// The policy as the engine takes it.
    pub fn policy(&self) -> Result<Mlp> {
        self.network.export(self.task.order())
    }
}

/// The weight of the mean over the steps, for a task that has to hold at every step.
fn stepwise(task: &Task<'_>, settings: &AnalyticSettings) -> Option<f64> {
    let roles = task.model.task.roles(task.spec.horizon);
    let chosen = roles.iter().any(|role| role.has(Role::CHANCE));
    settings.stepwise.filter(|weight| *weight > 0.0 && !chosen)
}

impl Learner for Analytic<'_> {
    fn update(&mut self, iteration: u64) -> Result<f64> {
        let (seed, batch) = (self.task.seed, self.settings.batch);
        let starts = self.task.mixture.draw(seed, purpose::START, iteration, batch);
        let bound = self.network.bind(&self.task.device);
        let measures = self.measures(&bound, starts.view(), self.temperature(iteration));
        let loss = self.gain(measures).neg();
        let gradient = bound.gradient(&loss.backward());
        let progress = [iteration, self.settings.iterations];
        let optimiser = &self.settings.optimiser;
        self.adam.update(&mut self.network.parameters, &gradient, optimiser, progress);
        Ok(device::number(loss))
    }

    fn score_names(&self) -> Vec<String> {
        let success = "share of held-out starts with G > 0".to_owned();
        let size = format!("mean measure, in units of {} and within -1 to 1", number(self.unit));
        std::iter::once(success).chain(self.settings.unit.map(|_| size)).collect()
    }

    fn scores(&self) -> Result<Vec<f64>> {
        let (starts, policy) = (self.held_out.view(), Arc::new(self.policy()?));
        let found = self.task.succeeds(Arc::clone(&policy), starts)?;
        let mut scores = vec![share(found.into_iter())];
        if self.settings.unit.is_some() {
            let Task { model, interface, backend, spec, .. } = &self.task;
            let plant = interface.plant(model, policy);
            scores.push(mean_measure(backend, &plant, *spec, starts, self.unit)?);
        }
        Ok(scores)
    }

    fn is_better(&self, new: &[f64], old: &[f64]) -> bool {
        new.partial_cmp(old).is_some_and(std::cmp::Ordering::is_gt)
    }

    fn networks(&self) -> Result<Vec<(&'static str, Mlp)>> {
        Ok(vec![("policy", self.policy()?)])
    }

    fn arrays(&mut self) -> Vec<(&'static str, &mut Vec<f32>)> {
        vec![
            ("parameters", &mut self.network.parameters),
            ("first", &mut self.adam.first),
            ("second", &mut self.adam.second),
        ]
    }
}
