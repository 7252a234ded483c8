//! Proximal policy optimisation on the ordinary reward of a task.

use std::array::from_fn;

use burn_tensor::Tensor;

use super::adam::Adam;
use super::analytic::{LAST, Task};
use super::device::{floats, number};
use super::environments::Environments;
use super::gae::{Step, advantages};
use super::network::{Architecture, Network};
use super::purpose;
use super::reward::Reward;
use super::run::Learner;
use super::score::{share, successes};
use super::settings::PpoSettings;
use crate::error::Result;
use crate::policy::{Activation, Mlp, OutputActivation};
use crate::rollout::{Plant, Stream};
use crate::system::System;

/// What is rewarded, and what the networks see.
#[derive(Clone, Debug)]
pub struct Lesson {
    /// The reward.
    pub reward: Reward,
    /// Interval of each state.
    pub states: Vec<[f32; 2]>,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
}

/// A Gaussian policy and the value of its states under training.
///
/// The control is normal around the network's output, which goes through tanh, with one standard
/// deviation per control for all states; the plant clips it. What is exported is the mean.
#[derive(Debug)]
pub struct Ppo<'a, S, const NX: usize, const NU: usize> {
    task: Task<'a, S, NX>,
    settings: PpoSettings,
    reward: Reward,
    environments: Environments<NX>,
    policy: Network,
    /// Logarithms of the standard deviations.
    spread: Vec<f32>,
    value: Network,
    /// Moments of policy, spread and value.
    moments: [Adam; 3],
    held_out: Vec<[f32; NX]>,
}

/// Steps of all plants under one policy, row by row.
#[derive(Clone, Debug, Default)]
struct Experience {
    /// States, `NX` a row.
    states: Vec<f32>,
    /// Controls as drawn, not clipped, `NU` a row.
    controls: Vec<f32>,
    /// Logarithms of their densities, but for a constant.
    densities: Vec<f32>,
    /// Advantages.
    advantages: Vec<f32>,
    /// What the value should be.
    returns: Vec<f32>,
}

impl<'a, S: System<NX, NU>, const NX: usize, const NU: usize> Ppo<'a, S, NX, NU> {
    /// Random networks, and plants at their starts.
    pub fn new(task: Task<'a, S, NX>, lesson: Lesson, settings: PpoSettings) -> Self {
        let Lesson { reward, states, hidden } = lesson;
        let random = |number: u32, outputs, output, last| {
            let (inputs, hidden, activation) = (states.clone(), hidden.clone(), Activation::Relu);
            let shape = Architecture { inputs, hidden, outputs, activation, output };
            Network::random(shape, Stream::new(task.seed, purpose::WEIGHT, number), last)
        };
        let policy = random(0, NU, OutputActivation::Tanh, LAST);
        let value = random(1, 1, OutputActivation::Identity, 1.0);
        let moments = [policy.parameters.len(), NU, value.parameters.len()].map(Adam::new);
        let (horizon, count) = (task.spec.horizon, settings.environments);
        Self {
            environments: Environments::new(task.mixture.clone(), task.seed, horizon, count),
            held_out: task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize),
            spread: vec![settings.spread.ln() as f32; NU],
            policy,
            value,
            moments,
            reward,
            settings,
            task,
        }
    }

    /// The policy as the engine takes it.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if a parameter is not finite.
    pub fn exported(&self) -> Result<Mlp> {
        self.policy.export(self.task.system.states().map(|axis| axis.name).to_vec())
    }

    /// Flies all plants for the steps of one iteration.
    fn fly(&mut self, iteration: u64) -> Experience {
        let (count, steps) = (self.environments.len(), self.settings.steps);
        let mut seen = Experience::default();
        let (mut flown, mut after) = (Vec::new(), Vec::new());
        for t in 0..steps {
            let number = iteration * steps as u64 + t as u64;
            let states = self.environments.each();
            let next = self.step(number, &states, &mut seen);
            let system = self.task.system;
            let violates = |x: &[f32; NX]| system.constraint(*x) <= 0.0;
            let last = self.environments.advance(number, &next, violates);
            for ((before, next), last) in states.iter().zip(&next).zip(last) {
                let reward = self.reward.of(system, *before, *next);
                flown.push((reward, violates(next), last));
            }
            after.extend_from_slice(next.as_flattened());
        }
        let device = &self.task.device;
        let told = |rows: &[f32]| {
            let rows = device.tensor(rows.to_vec(), [count * steps, NX]);
            floats(self.value.fixed(device).forward(rows).inner())
        };
        let values = told(&seen.states).into_iter().zip(told(&after));
        let steps: Vec<Step> = flown
            .into_iter()
            .zip(values)
            .map(|((reward, ended, last), (value, next))| Step {
                reward,
                value,
                next_value: if ended { 0.0 } else { next },
                last,
            })
            .collect();
        self.judge(&steps, &mut seen);
        seen
    }

    /// One step of all plants, number `number`: draws their controls, notes them, and returns the
    /// next states.
    fn step(&self, number: u64, states: &[[f32; NX]], seen: &mut Experience) -> Vec<[f32; NX]> {
        let device = &self.task.device;
        let rows = device.tensor(states.as_flattened().to_vec(), [states.len(), NX]);
        let means = floats(self.policy.fixed(device).forward(rows).inner());
        let noise = Stream::new(self.task.seed, purpose::NOISE, 0);
        let first = number * states.len() as u64;
        let next = |(i, (x, mean)): (usize, (&[f32; NX], &[f32]))| {
            let z = noise.normals(first + i as u64, NU);
            let u: [f32; NU] = from_fn(|j| mean[j] + self.spread[j].exp() * z[j]);
            let density = z.iter().zip(&self.spread).map(|(z, spread)| -0.5 * z * z - spread);
            seen.states.extend_from_slice(x);
            seen.controls.extend_from_slice(&u);
            seen.densities.push(density.sum());
            self.task.system.step(*x, u)
        };
        states.iter().zip(means.chunks_exact(NU)).enumerate().map(next).collect()
    }

    /// Advantages and returns of `steps`, plant after plant within each step.
    fn judge(&self, steps: &[Step], seen: &mut Experience) {
        let count = self.environments.len();
        seen.advantages = vec![0.0; steps.len()];
        for plant in 0..count {
            let own: Vec<Step> = steps.iter().skip(plant).step_by(count).copied().collect();
            let found = advantages(&own, self.task.spec.gamma, self.settings.lambda as f32);
            let places = seen.advantages.iter_mut().skip(plant).step_by(count);
            places.zip(found).for_each(|(place, advantage)| *place = advantage);
        }
        let sums = seen.advantages.iter().zip(steps);
        seen.returns = sums.map(|(advantage, step)| advantage + step.value).collect();
    }

    /// One update of policy, spread and value on the rows `chosen`; returns the loss.
    fn improve(&mut self, seen: &Experience, chosen: &[usize], progress: [u64; 2]) -> f64 {
        let (device, rows) = (&self.task.device, chosen.len());
        let take = |from: &[f32], columns: usize| {
            let row = |&i: &usize| from[i * columns..(i + 1) * columns].iter().copied();
            device.tensor(chosen.iter().flat_map(row).collect(), [rows, columns])
        };
        let states = take(&seen.states, NX);
        let (policy, value) = (self.policy.bind(device), self.value.bind(device));
        let spread = device.tensor(self.spread.clone(), [1, NU]).require_grad();
        let apart = take(&seen.controls, NU) - policy.forward(states.clone());
        let density = density(apart, &spread);
        let ratio = (density - take(&seen.densities, 1)).exp();
        let gain = clipped(ratio, scaled(take(&seen.advantages, 1)), self.settings.clip);
        let entropy = spread.clone().sum().mul_scalar(self.settings.entropy);
        let missed = value.forward(states) - take(&seen.returns, 1);
        let loss = (missed.clone() * missed).mean().mul_scalar(0.5) - gain - entropy;
        let slopes = loss.backward();
        let spreads = spread.grad(&slopes).map_or(vec![0.0; NU], floats);
        let gradients = [policy.gradient(&slopes), spreads, value.gradient(&slopes)];
        let parameters =
            [&mut self.policy.parameters, &mut self.spread, &mut self.value.parameters];
        let fitted = parameters.into_iter().zip(gradients).zip(&mut self.moments);
        for ((parameters, gradient), moments) in fitted {
            moments.update(parameters, &gradient, &self.settings.optimiser, progress);
        }
        number(loss)
    }

    /// The numbers below `count` in the random order number `number`.
    fn shuffled(&self, number: u64, count: usize) -> Vec<usize> {
        let stream = Stream::new(self.task.seed, purpose::CHOICE, 0);
        let first = number * count as u64;
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&i| (stream.words::<1>(first + i as u64, 0)[0][0], i));
        order
    }
}

/// Logarithm of the density `[rows, 1]` of normal numbers that lie `apart` from their means, but
/// for a constant; `spread` has the logarithms of the standard deviations.
fn density(apart: Tensor<2>, spread: &Tensor<2>) -> Tensor<2> {
    let z = apart / spread.clone().exp();
    ((z.clone() * z).mul_scalar(-0.5) - spread.clone()).sum_dim(1)
}

/// Mean gain of probabilities that change by `ratio`, where a change beyond `clip` gains nothing.
fn clipped(ratio: Tensor<2>, advantages: Tensor<2>, clip: f64) -> Tensor<1> {
    let held = ratio.clone().clamp(1.0 - clip, 1.0 + clip) * advantages.clone();
    (ratio * advantages).min_pair(held).mean()
}

/// Advantages with mean 0 and variance 1.
fn scaled(advantages: Tensor<2>) -> Tensor<2> {
    let centred = advantages.clone() - advantages.mean_dim(0);
    let variance = (centred.clone() * centred.clone()).mean_dim(0);
    centred / variance.sqrt().add_scalar(1e-8)
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> Learner for Ppo<'_, S, NX, NU> {
    fn update(&mut self, iteration: u64) -> Result<f64> {
        let seen = self.fly(iteration);
        let PpoSettings { epochs, batch, iterations, .. } = self.settings;
        let rows = seen.returns.len();
        let each = epochs * rows.div_ceil(batch) as u64;
        let (mut loss, mut done) = (0.0, iteration * each);
        for epoch in 0..epochs {
            let order = self.shuffled(iteration * epochs + epoch, rows);
            for chosen in order.chunks(batch) {
                loss += self.improve(&seen, chosen, [done, iterations * each]) / each as f64;
                done += 1;
            }
        }
        Ok(loss)
    }

    fn score_names(&self) -> Vec<String> {
        vec!["share of held-out starts with G > 0".to_owned()]
    }

    fn scores(&self) -> Result<Vec<f64>> {
        let Task { system, backend, spec, .. } = self.task;
        let plant = Plant { system, policy: &self.exported()? };
        Ok(vec![share(successes(backend, plant, spec, &self.held_out)?.into_iter())])
    }

    fn networks(&self) -> Result<Vec<(&'static str, Mlp)>> {
        Ok(vec![("policy", self.exported()?)])
    }

    fn arrays(&mut self) -> Vec<(&'static str, &mut Vec<f32>)> {
        let [policy, spread, value] = &mut self.moments;
        vec![
            ("policy", &mut self.policy.parameters),
            ("policy.first", &mut policy.first),
            ("policy.second", &mut policy.second),
            ("spread", &mut self.spread),
            ("spread.first", &mut spread.first),
            ("spread.second", &mut spread.second),
            ("value", &mut self.value.parameters),
            ("value.first", &mut value.first),
            ("value.second", &mut value.second),
            ("states", &mut self.environments.states),
            ("ages", &mut self.environments.ages),
        ]
    }
}
