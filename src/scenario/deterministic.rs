//! Deterministic certificates: every start of a ball, no sample, no risk.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::linear;
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{PairControl, RolloutSpec, States};
use crate::tube::{Nominal, Tube};

/// Halvings of the largest radius asked for until one is certified: below a millionth of it none is looked for.
const HALVINGS: u32 = 20;
/// Halvings of the bracket from there on: a certified radius is at most a hundredth short of what they reach.
const BISECTIONS: u32 = 7;

/// How the trajectories from a ball are enclosed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Of a plant that is linear in its state under replayed controls: the images of the ball themselves.
    Pieces,
    /// Of any plant: zonotopes that hold the images.
    Tube,
    /// Balls that grow by the Lipschitz constants of the steps, as published.
    Lipschitz,
}

impl Kind {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pieces => "pieces",
            Self::Tube => "tube",
            Self::Lipschitz => "lipschitz",
        }
    }
}

/// What is certified of a start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Whether every trajectory from the ball around it reaches the target safely.
    pub certified: bool,
    /// A number that the reach-avoid measure is nowhere below over the ball.
    #[serde(with = "crate::files::number")]
    pub margin: f64,
}

/// Certifies starts one by one: every start within a Euclidean ball around each, in real arithmetic with the f32
/// parameters of model and network.
///
/// ```
/// use reachcast::model::Plant;
/// use reachcast::rollout::{PairControl, RolloutSpec};
/// use reachcast::scenario::deterministic::{Deterministic, Kind};
/// use reachcast::system::{BangBang, DoubleIntegrator};
///
/// let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
/// let spec = RolloutSpec::new(30, 0.95)?;
/// let certificate = Deterministic::new(&plant, spec, PairControl::ClosedLoop, Kind::Tube)?;
/// // At rest half a metre from the middle, and too fast to stop before the wall.
/// let verdicts = certificate.verdicts([[0.5, 0.0], [0.9, 1.0]].as_slice().into(), 0.03);
/// assert!(verdicts[0].certified && verdicts[0].margin > 0.0);
/// assert!(!verdicts[1].certified);
/// // Of the largest ball asked for, how much is certified around the first.
/// assert!((0.1..0.5).contains(&certificate.radius(&[0.5, 0.0], 0.5)));
/// # Ok::<(), reachcast::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Deterministic<'a> {
    tube: Tube<'a>,
    kind: Kind,
}

impl<'a> Deterministic<'a> {
    /// Certificates of `plant` over the horizon of `spec`; perturbed trajectories are driven as `control` says.
    ///
    /// # Errors
    /// [`Error::Invalid`] for [`Kind::Pieces`] of a plant that is not linear in its state, or in closed loop.
    pub fn new(
        plant: &'a Plant,
        spec: RolloutSpec,
        control: PairControl,
        kind: Kind,
    ) -> Result<Self> {
        let linear = || linear::state_matrix(&plant.model, spec.horizon).is_some();
        if kind == Kind::Pieces && (control == PairControl::ClosedLoop || !linear()) {
            let problem = "`pieces` needs a system that is linear in its state and \
                           `control = \"replay\"`; use `tube`";
            return Err(Error::invalid("deterministic.kind", problem));
        }
        Ok(Self { tube: Tube::new(plant, spec, control), kind })
    }

    /// Steps T.
    pub fn horizon(&self) -> u32 {
        self.tube.horizon()
    }

    /// The nominal trajectory from `start`, `[states]`, enclosed.
    pub fn nominal(&self, start: &[f32]) -> Nominal {
        self.tube.nominal(start)
    }

    /// Whether the ball of `radius` around the start of `nominal` is certified, without the margin.
    fn certifies(&self, nominal: &Nominal, radius: f64) -> bool {
        match self.kind {
            Kind::Pieces | Kind::Tube => self.tube.certifies(nominal, radius),
            Kind::Lipschitz => self.tube.lipschitz_measure(nominal, radius) > 0.0,
        }
    }

    /// What is certified of the ball of `radius` around `start`.
    pub fn verdict(&self, start: &[f32], radius: f64) -> Verdict {
        let nominal = self.nominal(start);
        let margin = match self.kind {
            Kind::Pieces | Kind::Tube => self.tube.measure(&nominal, radius),
            Kind::Lipschitz => self.tube.lipschitz_measure(&nominal, radius),
        };
        Verdict { certified: margin > 0.0, margin }
    }

    /// The same of each of `starts`, on all threads.
    pub fn verdicts(&self, starts: States<'_>, radius: f64) -> Vec<Verdict> {
        self.each(starts, |start| self.verdict(start, radius))
    }

    /// Whether the ball around each of `starts` is certified, on all threads.
    pub fn certified(&self, starts: States<'_>, radius: f64) -> Vec<bool> {
        self.each(starts, |start| self.certifies(&self.nominal(start), radius))
    }

    /// A radius up to `most` of a ball around `start` that is certified, found by bisection:
    /// within a hundredth of the largest that bisection finds, 0 where none above a millionth of `most` is.
    pub fn radius(&self, start: &[f32], most: f64) -> f64 {
        let nominal = self.nominal(start);
        if !self.certifies(&nominal, 0.0) {
            return 0.0;
        }
        if self.certifies(&nominal, most) {
            return most;
        }
        let (mut low, mut high) = (0.5 * most, most);
        let mut halvings = 1;
        while !self.certifies(&nominal, low) {
            if halvings == HALVINGS {
                return 0.0;
            }
            (low, high, halvings) = (0.5 * low, low, halvings + 1);
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            match self.certifies(&nominal, middle) {
                true => low = middle,
                false => high = middle,
            }
        }
        low
    }

    /// The same for each of `starts`, on all threads.
    pub fn radii(&self, starts: States<'_>, most: f64) -> Vec<f64> {
        self.each(starts, |start| self.radius(start, most))
    }

    /// `work` on each of `starts`, on all threads.
    fn each<R: Send>(
        &self,
        starts: States<'_>,
        work: impl Fn(&[f32]) -> R + Send + Sync,
    ) -> Vec<R> {
        let starts: Vec<&[f32]> = starts.iter().collect();
        starts.into_par_iter().map(work).collect()
    }
}
