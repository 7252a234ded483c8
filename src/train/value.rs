//! Value networks by regression on the measures of the engine's own rollouts.

use super::adam::Adam;
use super::device::{Device, floats, number};
use super::network::Network;
use super::purpose;
use super::run::Learner;
use super::samples::Samples;
use super::settings::ValueSettings;
use crate::error::{Error, Result};
use crate::policy::Mlp;
use crate::rollout::Stream;

/// A network that learns the measures of samples.
#[derive(Debug)]
pub struct Value {
    name: &'static str,
    order: Vec<String>,
    settings: ValueSettings,
    choice: Stream,
    samples: Samples,
    held_out: Samples,
    device: Device,
    network: Network,
    adam: Adam,
}

/// What a value network is, and what it learns from.
#[derive(Clone, Debug)]
pub struct Lesson {
    /// Name of its file without ending.
    pub name: &'static str,
    /// Names of its inputs.
    pub order: Vec<String>,
    /// What it is trained on.
    pub samples: Samples,
    /// What it is scored on.
    pub held_out: Samples,
    /// Where tensors lie.
    pub device: Device,
    /// Seed of the choice of batches.
    pub seed: u64,
}

impl Value {
    /// Trains `network` from the parameters that it has.
    ///
    /// # Errors
    /// [`Error::Invalid`] if no sample has a finite measure.
    pub fn new(lesson: Lesson, network: Network, settings: ValueSettings) -> Result<Self> {
        let Lesson { name, order, samples, held_out, device, seed } = lesson;
        if samples.is_empty() || held_out.is_empty() {
            let problem = "every rollout meets a state that is not finite: nothing to learn from";
            return Err(Error::invalid("train.value", problem));
        }
        let choice = Stream::new(seed, purpose::CHOICE, 0);
        let adam = Adam::new(network.parameters.len());
        Ok(Self { name, order, settings, choice, samples, held_out, device, network, adam })
    }
}

impl Learner for Value {
    fn update(&mut self, iteration: u64) -> Result<f64> {
        let (rows, first) = (self.settings.batch, iteration * self.settings.batch as u64);
        let (mut inputs, mut measures) = (Vec::new(), Vec::new());
        for index in first..first + rows as u64 {
            let [[word], ..] = self.choice.words::<1>(index, 0);
            let chosen = word as usize % self.samples.len();
            inputs.extend_from_slice(self.samples.row(chosen));
            measures.push(self.samples.measures[chosen]);
        }
        let bound = self.network.bind(&self.device);
        let outputs = bound.forward(self.device.tensor(inputs, [rows, self.samples.columns]));
        let apart = (outputs - self.device.tensor(measures, [rows, 1])).abs();
        // Smooth L1: quadratic up to 1, then linear.
        let near = apart.clone().clamp_max(1.0);
        let loss = (near.clone() * (apart - near.mul_scalar(0.5))).mean();
        let gradient = bound.gradient(&loss.backward());
        let progress = [iteration, self.settings.iterations];
        let optimiser = &self.settings.optimiser;
        self.adam.update(&mut self.network.parameters, &gradient, optimiser, progress);
        Ok(number(loss))
    }

    fn score_names(&self) -> Vec<String> {
        vec![
            "share of held-out signs that are right".to_owned(),
            "R2 on held-out states".to_owned(),
        ]
    }

    fn scores(&self) -> Result<Vec<f64>> {
        let held_out = &self.held_out;
        let inputs =
            self.device.tensor(held_out.inputs.clone(), [held_out.len(), held_out.columns]);
        let told = floats(self.network.bind(&self.device).forward(inputs).inner());
        let pairs = || told.iter().zip(&held_out.measures);
        let right = pairs().filter(|(told, measure)| (**told > 0.0) == (**measure > 0.0)).count();
        let mean =
            held_out.measures.iter().map(|m| f64::from(*m)).sum::<f64>() / held_out.len() as f64;
        let squares = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            pairs().map(|(told, measure)| of(f64::from(*told), f64::from(*measure)).powi(2)).sum()
        };
        let (left, all) = (squares(&|told, m| told - m), squares(&|_, m| m - mean));
        // Equal measures leave nothing to explain.
        let explained = if all > 0.0 { 1.0 - left / all } else { 0.0 };
        Ok(vec![right as f64 / held_out.len() as f64, explained])
    }

    fn networks(&self) -> Result<Vec<(&'static str, Mlp)>> {
        Ok(vec![(self.name, self.network.export(self.order.clone())?)])
    }

    fn arrays(&mut self) -> Vec<(&'static str, &mut Vec<f32>)> {
        vec![
            ("parameters", &mut self.network.parameters),
            ("first", &mut self.adam.first),
            ("second", &mut self.adam.second),
        ]
    }
}
