//! Proximal policy optimisation on the ordinary reward of a task.

use burn_tensor::Tensor;

use super::adam::Adam;
use super::analytic::{LAST, Task};
use super::device::{floats, number};
use super::environments::Environments;
use super::gae::{Step, advantages};
use super::network::{Architecture, Network};
use super::purpose;
use super::reward::{Reward, Visited};
use super::rows::Rows;
use super::run::Learner;
use super::score::share;
use super::settings::PpoSettings;
use crate::error::Result;
use crate::policy::{Activation, Mlp};
use crate::rollout::{StateList, Stream};

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
/// What the policy says is normal around the network's output, which goes through tanh, with one standard
/// deviation per output for all states; the plant clips the control that comes of it. What is exported is the mean.
#[derive(Debug)]
pub struct Ppo<'a> {
    task: Task<'a>,
    settings: PpoSettings,
    reward: Reward,
    environments: Environments,
    policy: Network,
    /// Logarithms of the standard deviations.
    spread: Vec<f32>,
    value: Network,
    /// Moments of policy, spread and value.
    moments: [Adam; 3],
    held_out: StateList,
}

/// Steps of all plants under one policy, row by row.
#[derive(Clone, Debug, Default)]
struct Experience {
    /// States, row by row.
    states: Vec<f32>,
    /// What the policy's network sees of them, row by row.
    seen: Vec<f32>,
    /// Outputs as drawn, not clipped, row by row.
    outputs: Vec<f32>,
    /// Logarithms of their densities, but for a constant.
    densities: Vec<f32>,
    /// Advantages.
    advantages: Vec<f32>,
    /// What the value should be.
    returns: Vec<f32>,
}

impl<'a> Ppo<'a> {
    /// Random networks, and plants at their starts.
    pub fn new(task: Task<'a>, lesson: Lesson, settings: PpoSettings) -> Self {
        let Lesson { reward, states, hidden } = lesson;
        let width = task.interface.outputs;
        let seen = task.interface.intervals(&states);
        let random = |number: u32, inputs, outputs, output, last| {
            let (hidden, activation) = (hidden.clone(), Activation::Relu);
            let shape = Architecture { inputs, hidden, outputs, activation, output };
            Network::random(shape, Stream::new(task.seed, purpose::WEIGHT, number), last)
        };
        let policy = random(0, seen, width, Activation::Tanh, LAST);
        let value = random(1, states, 1, Activation::Identity, 1.0);
        let moments = [policy.parameters.len(), width, value.parameters.len()].map(Adam::new);
        let (horizon, count) = (task.spec.horizon, settings.environments);
        Self {
            environments: Environments::new(task.mixture.clone(), task.seed, horizon, count),
            held_out: task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize),
            spread: vec![settings.spread.ln() as f32; width],
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
        self.policy.export(self.task.order())
    }

    /// Flies all plants for the steps of one iteration.
    fn fly(&mut self, iteration: u64) -> Experience {
        let (count, steps) = (self.environments.len(), self.settings.steps);
        let mut seen = Experience::default();
        let (mut flown, mut after) = (Vec::new(), Vec::new());
        for t in 0..steps {
            let number = iteration * steps as u64 + t as u64;
            let Environments { states, ages, .. } = self.environments.clone();
            let next = self.step(number, [&states, &ages], &mut seen);
            let later: Vec<f32> = ages.iter().map(|age| age + 1.0).collect();
            let [before, after_it] = [(&states, &ages), (&next, &later)]
                .map(|(states, steps)| Rows { steps, ..Rows::new(&self.task.model, states) });
            let margins = [before.margins(), after_it.margins()];
            let violates = |i: usize| margins[1][i].constraint <= 0.0;
            let last = self.environments.advance(number, after_it.states, violates);
            for (i, last) in last.into_iter().enumerate() {
                let [before, next] =
                    [(before, &margins[0]), (after_it, &margins[1])].map(|(rows, margins)| {
                        Visited { state: rows.states.row(i), margins: margins[i] }
                    });
                flown.push((self.reward.of(before, next), violates(i), last));
            }
            after.extend_from_slice(&next);
        }
        let device = &self.task.device;
        let told = |rows: &[f32]| {
            let rows = device.tensor(rows.to_vec(), [count * steps, rows.len() / (count * steps)]);
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
        self.weigh(&steps, &mut seen);
        seen
    }

    /// One step of all plants, number `number`: draws what the policy says, notes it, and returns the
    /// next states.
    fn step(&self, number: u64, [states, ages]: [&[f32]; 2], seen: &mut Experience) -> Vec<f32> {
        let (device, model) = (&self.task.device, &self.task.model);
        let (count, width) = (ages.len(), self.spread.len());
        let rows = Rows { steps: ages, ..Rows::new(model, states) };
        let observed = rows.seen(&self.task.interface);
        let columns = observed.len() / count;
        let inputs = device.tensor(observed.clone(), [count, columns]);
        let means = floats(self.policy.fixed(device).forward(inputs).inner());
        let noise = Stream::new(self.task.seed, purpose::NOISE, 0);
        let first = number * count as u64;
        let mut outputs = Vec::with_capacity(count * width);
        for (i, mean) in means.chunks_exact(width).enumerate() {
            let z = noise.normals(first + i as u64, width);
            outputs.extend((0..width).map(|j| mean[j] + self.spread[j].exp() * z[j]));
            let density = z.iter().zip(&self.spread).map(|(z, spread)| -0.5 * z * z - spread);
            seen.densities.push(density.sum());
        }
        let next = rows.next(&rows.controls(&self.task.interface, &outputs));
        seen.states.extend_from_slice(states);
        seen.seen.extend(observed);
        seen.outputs.extend(outputs);
        next
    }

    /// Advantages and returns of `steps`, plant after plant within each step.
    fn weigh(&self, steps: &[Step], seen: &mut Experience) {
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
        let width = self.spread.len();
        let states = take(&seen.states, self.task.model.states.len());
        let observed = take(&seen.seen, seen.seen.len() / seen.returns.len());
        let (policy, value) = (self.policy.bind(device), self.value.bind(device));
        let spread = device.tensor(self.spread.clone(), [1, width]).require_grad();
        let apart = take(&seen.outputs, width) - policy.forward(observed);
        let density = density(apart, &spread);
        let ratio = (density - take(&seen.densities, 1)).exp();
        let gain = clipped(ratio, scaled(take(&seen.advantages, 1)), self.settings.clip);
        let entropy = spread.clone().sum().mul_scalar(self.settings.entropy);
        let missed = value.forward(states) - take(&seen.returns, 1);
        let loss = (missed.clone() * missed).mean().mul_scalar(0.5) - gain - entropy;
        let slopes = loss.backward();
        let spreads = spread.grad(&slopes).map_or(vec![0.0; width], floats);
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

impl Learner for Ppo<'_> {
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
        let found = self.task.succeeds(self.exported()?, self.held_out.view())?;
        Ok(vec![share(found.into_iter())])
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
