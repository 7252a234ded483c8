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
use super::soft::{measure_tape, step_tape};
use super::starts::Mixture;
use super::tape::Tape;
use crate::backend::Backend;
use crate::error::Result;
use crate::policy::Mlp;
use crate::rollout::{Plant, RolloutSpec, Tightening};
use crate::system::System;

/// Weights of the last layer at first, as a share of the others': no output is near saturation.
pub const LAST: f32 = 0.1;

/// What is trained, on what.
#[derive(Clone, Debug)]
pub struct Task<'a, S, const NX: usize> {
    /// The system.
    pub system: &'a S,
    /// Who runs the rollouts that the policy is scored by.
    pub backend: &'a Backend,
    /// Where its tensors lie.
    pub device: Device,
    /// Length and discount of a rollout.
    pub spec: RolloutSpec,
    /// What the margins lose in `V_check`; none if it has no part in the objective.
    pub tightening: Option<Tightening>,
    /// Where starts are drawn from.
    pub mixture: Mixture<NX>,
    /// Starts that the policy is scored on.
    pub held_out: u64,
    /// Seed of every stream.
    pub seed: u64,
}

/// A policy under training.
#[derive(Debug)]
pub struct Analytic<'a, S, const NX: usize, const NU: usize> {
    task: Task<'a, S, NX>,
    settings: AnalyticSettings,
    step: Arc<Tape>,
    measure: Arc<Tape>,
    network: Network,
    adam: Adam,
    held_out: Vec<[f32; NX]>,
}

impl<'a, S: System<NX, NU>, const NX: usize, const NU: usize> Analytic<'a, S, NX, NU> {
    /// Trains `network` from the parameters that it has.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if a formula of the system has no derivatives.
    pub fn new(
        task: Task<'a, S, NX>,
        network: Network,
        settings: AnalyticSettings,
    ) -> Result<Self> {
        let held_out = task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize);
        let step = Arc::new(step_tape(task.system)?);
        let measure = measure_tape(task.system, &task.spec, task.tightening.as_ref())?;
        Ok(Self {
            step,
            measure: Arc::new(measure),
            adam: Adam::new(network.parameters.len()),
            network,
            held_out,
            task,
            settings,
        })
    }

    /// The softened measures `[starts, 1 or 2]` of rollouts under `network`: G and `V_check`.
    pub fn measures(&self, network: &Bound, starts: &[[f32; NX]], temperature: f32) -> Tensor<2> {
        let mut x = self.task.device.tensor(starts.as_flattened().to_vec(), [starts.len(), NX]);
        let mut states = vec![x.clone()];
        for _ in 0..self.task.spec.horizon {
            let u = network.forward(x.clone());
            x = apply(&self.step, temperature, [x, u]);
            states.push(x.clone());
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
        let order = self.task.system.states().map(|axis| axis.name);
        self.network.export(order.to_vec())
    }
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> Learner for Analytic<'_, S, NX, NU> {
    fn update(&mut self, iteration: u64) -> Result<f64> {
        let (seed, batch) = (self.task.seed, self.settings.batch);
        let starts = self.task.mixture.draw(seed, purpose::START, iteration, batch);
        let bound = self.network.bind(&self.task.device);
        let measures = self.measures(&bound, &starts, self.temperature(iteration));
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
        let Task { system, backend, spec, .. } = self.task;
        let plant = Plant { system, policy: &self.policy()? };
        Ok(vec![share(successes(backend, plant, spec, &self.held_out)?.into_iter())])
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
