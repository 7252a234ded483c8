//! A policy by back-propagation of the softened measure through the known dynamics.

use std::sync::Arc;

use burn_tensor::Tensor;

use super::adam::Adam;
use super::device::{Device, number};
use super::network::{Bound, Network};
use super::physics::apply;
use super::purpose;
use super::run::Learner;
use super::score::{share, successes};
use super::settings::AnalyticSettings;
use super::soft::{measure_tape, part_tapes};
use super::starts::Mixture;
use super::tape::Tape;
use crate::backend::Backend;
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::policy::Mlp;
use crate::rollout::{RolloutSpec, StateList, States, Tightening};

/// Weights of the last layer at first, as a share of the others': no output is near saturation.
pub const LAST: f32 = 0.1;

/// What is trained, on what.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// The plant.
    pub model: Arc<Model>,
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
    /// The parts of a step.
    parts: Vec<Arc<Tape>>,
    measure: Arc<Tape>,
    network: Network,
    adam: Adam,
    held_out: StateList,
}

impl Task<'_> {
    /// Names of the states, in order.
    pub(super) fn order(&self) -> Vec<String> {
        self.model.states.iter().map(|axis| axis.name.clone()).collect()
    }

    /// Whether each of `starts` succeeds under `network`.
    pub(super) fn succeeds(
        &self,
        network: impl Into<Arc<Mlp>>,
        starts: States<'_>,
    ) -> Result<Vec<bool>> {
        successes(self.backend, &Plant::under(&self.model, network), self.spec, starts)
    }
}

impl<'a> Analytic<'a> {
    /// Trains `network` from the parameters that it has.
    pub fn new(task: Task<'a>, network: Network, settings: AnalyticSettings) -> Self {
        let held_out = task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize);
        Self {
            parts: part_tapes(&task.model).into_iter().map(Arc::new).collect(),
            measure: Arc::new(measure_tape(&task.model, &task.spec, task.tightening.as_ref())),
            adam: Adam::new(network.parameters.len()),
            network,
            held_out,
            task,
            settings,
        }
    }

    /// The softened measures `[starts, 1 or 2]` of rollouts under `network`: G and `V_check`.
    pub fn measures(&self, network: &Bound, starts: States<'_>, temperature: f32) -> Tensor<2> {
        let (device, count) = (&self.task.device, starts.len());
        let mut x = device.tensor(starts.numbers().to_vec(), [count, starts.size()]);
        let mut states = vec![x.clone()];
        for step in 0..self.task.spec.horizon {
            let u = network.forward(x.clone());
            let step = device.tensor(vec![step as f32; count], [count, 1]);
            for part in &self.parts {
                x = apply(part, temperature, [x, u.clone(), step.clone()]);
                states.push(x.clone());
            }
        }
        apply(&self.measure, temperature, [Tensor::cat(states, 1)])
    }

    /// Mean gain `tanh(g / scale) + slope g / scale` of the measures, the certified one weighted.
    fn gain(&self, measures: Tensor<2>) -> Tensor<1> {
        let AnalyticSettings { scale, slope, certified, .. } = self.settings;
        let [rows, columns] = measures.dims();
        let scaled = measures.div_scalar(scale);
        let gains = scaled.clone().tanh() + scaled.mul_scalar(slope);
        let weights = [1.0, certified as f32][..columns].to_vec();
        (gains * self.task.device.tensor(weights, [1, columns])).sum().div_scalar(rows as f64)
    }

    /// The temperature of an iteration.
    fn temperature(&self, iteration: u64) -> f32 {
        let AnalyticSettings { temperature: [first, last], iterations, .. } = self.settings;
        let share = iteration as f64 / (iterations.max(2) - 1) as f64;
        (first * (last / first).powf(share)) as f32
    }

    /// The policy as the engine takes it.
    pub fn policy(&self) -> Result<Mlp> {
        self.network.export(self.task.order())
    }
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
        Ok(number(loss))
    }

    fn score_names(&self) -> Vec<String> {
        vec!["share of held-out starts with G > 0".to_owned()]
    }

    fn scores(&self) -> Result<Vec<f64>> {
        let found = self.task.succeeds(self.policy()?, self.held_out.view())?;
        Ok(vec![share(found.into_iter())])
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
