//! The tasks that a backend runs, and their results.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::starts::{Pairs, Starts};
use crate::error::{Error, Result};

/// Longest horizon, steps.
pub const MAX_HORIZON: u32 = 10_000;

/// Length and discount of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RolloutSpec {
    /// Steps T; the states are x_0..=x_T.
    pub horizon: u32,
    /// Discount per step, in (0, 1].
    pub gamma: f32,
}

impl RolloutSpec {
    /// A checked specification.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the horizon is 0 or above [`MAX_HORIZON`], or gamma is outside (0, 1].
    pub fn new(horizon: u32, gamma: f32) -> Result<Self> {
        let spec = Self { horizon, gamma };
        spec.check().map(|()| spec)
    }

    /// Refuses a specification that [`RolloutSpec::new`] would not make.
    pub(crate) fn check(&self) -> Result<()> {
        let &Self { horizon, gamma } = self;
        if !(1..=MAX_HORIZON).contains(&horizon) {
            let problem = format!("{horizon} is not within 1..={MAX_HORIZON} steps");
            return Err(Error::invalid("horizon", problem));
        }
        if !(gamma > 0.0 && gamma <= 1.0) {
            return Err(Error::invalid("gamma", format!("{gamma} is outside (0, 1]")));
        }
        Ok(())
    }
}

/// How the numbers of a [`Tightening`] act on the margins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effect {
    /// They are taken off.
    #[default]
    Subtracted,
    /// They are multiplied with: margins in units of their own at each step.
    Multiplied,
}

/// What both margins lose at each step, `[T + 1]` each: `L_r Delta_t` and `L_c Delta_t`, or the drops that
/// are allowed for; or the units that they are measured in, as [`Effect`] says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tightening {
    /// Taken off the target margin, or its factor.
    pub target: Vec<f32>,
    /// Taken off the constraint margin, or its factor.
    pub constraint: Vec<f32>,
    /// Which of both.
    pub effect: Effect,
}

impl Tightening {
    /// Nothing taken off.
    pub fn none(spec: &RolloutSpec) -> Self {
        let zero = vec![0.0; spec.horizon as usize + 1];
        Self::losing(zero.clone(), zero)
    }

    /// Margins that lose `target` and `constraint`, `[T + 1]` each.
    pub fn losing(target: Vec<f32>, constraint: Vec<f32>) -> Self {
        Self { target, constraint, effect: Effect::Subtracted }
    }

    /// `margin` with `number` taken off, or multiplied with it.
    pub(crate) fn acted(&self, margin: f64, number: f32) -> f64 {
        match self.effect {
            Effect::Subtracted => margin - f64::from(number),
            Effect::Multiplied => margin * f64::from(number),
        }
    }
}

/// What is wanted of each start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The reach-avoid measure.
    Measure,
    /// Its sign, 1 or -1, of a rollout that stops once it is decided; [`super::NON_FINITE`] where
    /// a state that is not finite decides.
    Sign,
}

/// Reach-avoid measures of a range of starts.
#[derive(Clone, Debug)]
pub struct ReachAvoidTask<'a> {
    /// The starts.
    pub starts: Starts<'a>,
    /// Which of them, by index.
    pub range: Range<u64>,
    /// Horizon and discount.
    pub spec: RolloutSpec,
    /// What the margins lose; `[T + 1]`.
    pub tightening: &'a Tightening,
    /// Measure or sign.
    pub query: Query,
}

/// How the perturbed rollout of a pair is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairControl {
    /// By the controls of the nominal rollout.
    Replay,
    /// By the policy in feedback.
    ClosedLoop,
}

/// Rollouts of a range of pairs.
#[derive(Clone, Debug)]
pub struct DeviationTask<'a> {
    /// The pairs.
    pub pairs: Pairs<'a>,
    /// Which of them, by index.
    pub range: Range<u64>,
    /// Horizon and discount.
    pub spec: RolloutSpec,
    /// What the margins of the nominal rollout lose; `[T + 1]`.
    pub tightening: &'a Tightening,
    /// How the perturbed rollout is driven.
    pub control: PairControl,
}

/// Reach-avoid measures of one pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PairMeasure {
    /// Of the nominal rollout, with tightened margins: `V_check`.
    pub nominal: f32,
    /// Of the perturbed rollout, with the margins as they are.
    pub perturbed: f32,
}

/// The largest distance within a pair at one step, and the first pair that attains it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Farthest {
    /// Euclidean distance; [`super::HUGE`] where a state is not finite.
    #[serde(with = "crate::files::number")]
    pub distance: f32,
    /// Index of the pair.
    pub pair: u64,
}

impl Farthest {
    /// No pair seen yet.
    pub const NONE: Self = Self { distance: 0.0, pair: u64::MAX };

    /// The farther of two; of equal ones the first pair.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let before = other.distance == self.distance && other.pair < self.pair;
        if other.distance > self.distance || before { other } else { self }
    }

    /// Merges what others found into `all`, step by step.
    pub(crate) fn merge_steps(all: &mut [Self], found: &[Self]) {
        all.iter_mut().zip(found).for_each(|(mine, other)| *mine = mine.merge(*other));
    }
}
