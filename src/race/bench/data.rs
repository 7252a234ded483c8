//! What the workloads run on: networks, starts and a planning problem, functions of the seed alone.

use std::sync::Arc;

use crate::bench;
use crate::error::{Error, Result};
use crate::policy::{Activation, Layer, Mlp};
use crate::race::cost::{Fence, LaneCost, RaceCost, RaceReference, Safety};
use crate::race::system::DroneRace;
use crate::rollout::{
    MppiProblem, MppiSettings, MppiSpec, Purpose, Region, RolloutSpec, Sigma, Starts, Stream,
};
use crate::system::System;

/// Steps of a rollout.
pub const HORIZON: u32 = 30;
/// Discount of a rollout.
pub const GAMMA: f32 = 0.95;
/// Steps of a plan.
pub const PLAN: u32 = 20;
/// Temperature of the plans.
pub const TEMPERATURE: f32 = 10.0;
/// Standard deviation of each control.
pub const SIGMA: f32 = 0.4;
/// Speed toward the gate that the plans keep, m/s.
pub const SPEED: f32 = 0.7;
/// Where the plans start.
pub const PLAN_START: [f32; 12] = [0.3, 0.0, -1.5, 0.6, 0.0, 0.0, -0.3, 0.0, -1.6, 0.4, 0.0, 0.0];

/// Hidden layers of the networks with random weights.
const HIDDEN: [(&str, &[usize]); 3] =
    [("3x64", &[64; 3]), ("3x128", &[128; 3]), ("4x512", &[512; 4])];
/// The trained policy of the race, and the starts of its study.
const POLICY: &[u8] = include_bytes!("../../../configs/policies/race_policy.safetensors");
const STUDY: &str = include_str!("../../../configs/race_starts_500.csv");

/// Number of starts.
pub const STARTS: usize = 65_536;
/// Farthest that a coordinate of a start is from that of a start of the study, m or m/s.
const NEAR: f32 = 0.05;
/// Number of the stream of the starts; networks have those from 0 on.
const STARTS_STREAM: u32 = 1 << 16;

/// Networks and starts.
#[derive(Clone, Debug)]
pub struct Data {
    /// Relu networks from 12 states to 3 controls with random weights, by name.
    pub networks: Vec<(&'static str, Arc<Mlp>)>,
    /// The trained policy of the race.
    pub policy: Arc<Mlp>,
    /// Starts near those of the study: number i is near its start i modulo 500.
    pub starts: Arc<[[f32; 12]]>,
    /// Seed of all of them.
    pub seed: u64,
}

impl Data {
    /// The data of a seed.
    ///
    /// # Errors
    /// [`Error::Invalid`] if what is compiled in is damaged.
    pub fn new(seed: u64) -> Result<Self> {
        let network = |(number, (name, hidden)): (usize, &(&'static str, &[usize]))| {
            let widths = [&[12], *hidden, &[3]].concat();
            Ok((*name, Arc::new(random_network(&widths, seed, number as u32)?)))
        };
        let policy = Mlp::from_bytes(POLICY);
        let policy = policy.map_err(|problem| Error::invalid("the policy of the race", problem))?;
        Ok(Self {
            networks: HIDDEN.iter().enumerate().map(network).collect::<Result<_>>()?,
            policy: Arc::new(policy),
            starts: race_starts(seed)?,
            seed,
        })
    }

    /// The network `name`, if there is one.
    pub fn network(&self, name: &str) -> Option<&Arc<Mlp>> {
        self.networks.iter().find(|(own, _)| *own == name).map(|(_, network)| network)
    }
}

/// Horizon and discount of the rollouts.
///
/// # Errors
/// None: the numbers are valid.
pub fn rollout_spec() -> Result<RolloutSpec> {
    RolloutSpec::new(HORIZON, GAMMA)
}

/// A relu network with weights that keep the size of its activations, and small biases.
fn random_network(widths: &[usize], seed: u64, number: u32) -> Result<Mlp> {
    let stream = Stream::new(seed, bench::PURPOSE, number);
    let mut drawn = 0;
    let mut layer = |inputs: usize, outputs: usize| {
        let scale = (6.0 / inputs as f32).sqrt();
        let uniform = Region::new_box([-scale], [scale])?;
        let first = drawn;
        drawn += (inputs * outputs) as u64;
        let weight = |index| uniform.point(stream, index)[0];
        Ok(Layer::dense((first..drawn).map(weight).collect(), vec![0.1; outputs]))
    };
    let layers = widths.windows(2).map(|pair| layer(pair[0], pair[1])).collect::<Result<_>>()?;
    Mlp::new(layers, Activation::Relu, Activation::Tanh)
}

/// [`STARTS`] starts near those of the study.
fn race_starts(seed: u64) -> Result<Arc<[[f32; 12]]>> {
    let study = study_starts()?;
    let region = Region::new_box([-NEAR; 12], [NEAR; 12])?;
    let offsets =
        Starts::Drawn { region, stream: Stream::new(seed, bench::PURPOSE, STARTS_STREAM) };
    let near = |i: usize| {
        let (start, offset) = (study[i % study.len()], offsets.start(i as u64));
        std::array::from_fn(|axis| start[axis] + offset[axis])
    };
    Ok((0..STARTS).map(near).collect())
}

/// The 500 starts of the study.
///
/// # Errors
/// [`Error::Invalid`] if what is compiled in is damaged.
pub fn study_starts() -> Result<Vec<[f32; 12]>> {
    let row = |line: &str| {
        let cells: Option<Vec<f32>> = line.split(',').map(|cell| cell.parse().ok()).collect();
        cells.and_then(|cells| cells.try_into().ok())
    };
    let lines = STUDY.lines().skip(1);
    let starts: Option<Vec<_>> = lines.map(row).collect();
    starts.ok_or_else(|| Error::invalid("the starts of the study", "a row has not 12 numbers"))
}

/// The cost of lane plans.
pub fn lane() -> RaceCost {
    RaceCost::Lane(LaneCost {
        lane: 25e3,
        speed: 2.0,
        control: 0.001,
        away: 5e4,
        wide: 5e4,
        last: 1e4,
        safety: Safety::NONE,
        fence: Fence::NONE,
    })
}

/// Settings of `samples` samples.
///
/// # Errors
/// [`Error::Invalid`] if there are none or too many.
pub fn mppi_spec(samples: u32) -> Result<MppiSpec> {
    MppiSpec::new(MppiSettings {
        temperature: TEMPERATURE,
        sigma: Sigma::PerControl(vec![SIGMA; 3]),
        ..MppiSettings::new(&DroneRace::default().controls(), samples, PLAN)
    })
}

/// Problem `number`: from [`PLAN_START`] at [`SPEED`], with noise of its own.
pub fn mppi_problem(seed: u64, number: u32) -> MppiProblem {
    let context = |t| {
        RaceReference { speed: SPEED, last: t + 1 == PLAN, ..RaceReference::default() }.context()
    };
    let contexts: Vec<_> = (0..PLAN).map(context).collect();
    let stream = Stream::new(seed, Purpose::CONTROL_NOISE, number);
    MppiProblem::new(PLAN_START, &[[0.0; 3]; PLAN as usize], &contexts, stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_are_functions_of_the_seed() {
        let (one, same, other) = (Data::new(1), Data::new(1), Data::new(2));
        let (one, same, other) = (one.unwrap(), same.unwrap(), other.unwrap());
        assert_eq!(one.starts, same.starts);
        assert_ne!(one.starts, other.starts);
        let digest = |data: &Data| data.network("3x128").map(|network| network.digest());
        assert_eq!(digest(&one), digest(&same));
        assert_ne!(digest(&one), digest(&other));
        assert!(one.network("5x5").is_none());
    }

    #[test]
    fn starts_lie_near_those_of_the_study() {
        let (data, study) = (Data::new(1).unwrap(), study_starts().unwrap());
        assert_eq!(study.len(), 500);
        assert_eq!(data.starts.len(), STARTS);
        let mut widest: f32 = 0.0;
        for (i, start) in data.starts.iter().enumerate() {
            let gaps = start.iter().zip(&study[i % 500]).map(|(a, b)| (a - b).abs());
            widest = gaps.fold(widest, f32::max);
        }
        assert!(widest <= NEAR * 1.0001 && widest > 0.99 * NEAR, "{widest}");
    }
}
