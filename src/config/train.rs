//! Defaults of training for each system, and its starts as checked boxes.

use std::collections::BTreeMap;

use super::section::Config;
use super::settings::{finite_interval, state_index};
use crate::error::{Error, Result};
use crate::rollout::Region;
use crate::system::Axis;
use crate::train::adam::Optimiser;
use crate::train::settings::{
    AnalyticSettings, DdpgSettings, Method, PpoSettings, RewardSettings, StartsSection,
    TrainSettings, ValueSettings,
};
use crate::train::starts::Mixture;

/// Training for the double integrator.
pub(super) fn double_integrator() -> TrainSettings {
    let mut settings = common(vec![32; 2]);
    settings.analytic.iterations = 1000;
    settings.analytic.certified = 0.0;
    settings.value.states = 50_000;
    settings.ddpg.disturbance = named(&[("velocity", 0.01)]);
    settings.ppo.reward.goal = named(&[("position", 0.0)]);
    settings
}

/// What all systems share.
pub(crate) fn common(hidden: Vec<usize>) -> TrainSettings {
    let optimiser =
        Optimiser { rate: 4e-3, warmup: 20, last: 0.02, clip: 1.0, decays: [0.9, 0.99] };
    TrainSettings {
        method: Method::Analytic,
        hidden,
        starts: vec![part(1.0, &[])],
        held_out: 4096,
        interval: 100,
        patience: 20,
        analytic: AnalyticSettings {
            iterations: 4500,
            batch: 256,
            temperature: [1.0, 0.1],
            scale: 2.0,
            slope: 0.05,
            certified: 0.5,
            unit: None,
            stepwise: None,
            gamma: None,
            optimiser,
        },
        value: ValueSettings {
            iterations: 12_000,
            batch: 1024,
            states: 200_000,
            visited: 0.3,
            optimiser: Optimiser { rate: 3e-3, decays: [0.9, 0.999], ..optimiser },
        },
        ddpg: ddpg(),
        ppo: ppo(),
    }
}

/// DDPG with the rates, the noise and the copies of the published line of work.
fn ddpg() -> DdpgSettings {
    DdpgSettings {
        iterations: 100_000,
        batch: 256,
        environments: 16,
        replay: 1 << 17,
        noise: 0.1,
        random: 0.5,
        polyak: 0.005,
        disturbance: BTreeMap::new(),
        critic: constant(1e-3, 1.0),
        actor: constant(1e-4, 1.0),
    }
}

/// PPO with the clip, the weights and the entropy of the published baseline.
fn ppo() -> PpoSettings {
    PpoSettings {
        iterations: 600,
        environments: 64,
        steps: 32,
        epochs: 4,
        batch: 256,
        clip: 0.2,
        lambda: 0.95,
        entropy: 0.004,
        spread: 0.5,
        reward: RewardSettings {
            goal: BTreeMap::new(),
            progress: 1.0,
            target: 1.0,
            violation: 2.0,
        },
        optimiser: constant(1e-3, 0.5),
    }
}

/// A rate that stays as it is.
fn constant(rate: f64, clip: f64) -> Optimiser {
    Optimiser { rate, warmup: 0, last: 1.0, clip, decays: [0.9, 0.999] }
}

/// Numbers by state name.
pub(crate) fn named(numbers: &[(&str, f64)]) -> BTreeMap<String, f64> {
    numbers.iter().map(|(name, number)| ((*name).to_owned(), *number)).collect()
}

/// The whole box but for these intervals.
pub(crate) fn part(share: f64, bounds: &[(&str, [f64; 2])]) -> StartsSection {
    let bounds = bounds.iter().map(|(name, interval)| ((*name).to_owned(), *interval));
    StartsSection { share, bounds: bounds.collect() }
}

impl Config {
    /// The settings of training, checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key whose value is out of range.
    pub fn train_settings(&self) -> Result<&TrainSettings> {
        let settings = self.train.as_ref();
        let settings = settings.ok_or_else(|| Error::invalid("train", "no such section"))?;
        settings.check().map_err(|error| self.placed(error))?;
        Ok(settings)
    }

    /// Where training draws its starts from.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key whose interval is empty, not finite or of no state.
    pub fn mixture(&self, axes: &[Axis]) -> Result<Mixture> {
        let (low, high) = self.corners(axes)?;
        let part = |(number, part): (usize, &StartsSection)| {
            let (mut low, mut high) = (low.clone(), high.clone());
            let place = format!("train.starts[{number}].box");
            for (name, interval) in &part.bounds {
                let i = state_index(&place, name, axes)?;
                [low[i], high[i]] = finite_interval(&format!("{place}.{name}"), *interval)?;
            }
            Ok((part.share, Region::new_box(low, high)?))
        };
        let parts = self.train_settings()?.starts.iter().enumerate().map(part);
        Ok(Mixture { parts: parts.collect::<Result<_>>()? })
    }

    /// The coordinates that a disturbance pushes in training, in order, with its scales.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key of no state, and those of [`Self::train_settings`].
    pub fn disturbed(&self, axes: &[Axis]) -> Result<Vec<(usize, f32)>> {
        coordinates("train.ddpg.disturbance", &self.train_settings()?.ddpg.disturbance, axes)
    }

    /// The goal of the ordinary reward: coordinates, in order, with its place.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key of no state, and those of [`Self::train_settings`].
    pub fn goal(&self, axes: &[Axis]) -> Result<Vec<(usize, f32)>> {
        coordinates("train.ppo.reward.goal", &self.train_settings()?.ppo.reward.goal, axes)
    }
}

/// The numbers of states by their coordinates, in order.
fn coordinates(
    place: &str,
    named: &BTreeMap<String, f64>,
    axes: &[Axis],
) -> Result<Vec<(usize, f32)>> {
    let entry =
        |(name, number): (&String, &f64)| Ok((state_index(place, name, axes)?, *number as f32));
    let mut entries = named.iter().map(entry).collect::<Result<Vec<_>>>()?;
    entries.sort_by_key(|(i, _)| *i);
    Ok(entries)
}
