//! What a certificate is asked for: the resolved settings of one system, without file or key.

use serde::{Deserialize, Serialize};

use super::bound::CountRule;
use super::box_settings::BoxSettings;
use super::constant_record::Assumption;
use super::deterministic::Kind;
use super::deterministic_settings::DeterministicSettings;
use super::drops_settings::DropSettings;
use super::growth_plan::GrowthPlan;
use super::key_source::Keys;
use super::sequential_record::SequentialSettings;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::{PairControl, RolloutSpec};

/// Cells of a default slice along each axis.
const SLICE_CELLS: u16 = 21;

/// How the deviation bounds of all steps hold together, `docs/method.md` section 8.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Joint {
    /// One scalar scales a shape fixed by an independent pilot sample: d = 1.
    FixedShape,
    /// The bound of every step but the first is a decision variable: d = T.
    Variables,
    /// Each step on its own with risk and beta divided by their number.
    Bonferroni,
    /// Each step on its own at full risk, as published: no joint statement.
    Separate,
}

/// Which deviation bound tightens the margins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviationSource {
    /// The scenario bound.
    Scenario,
    /// The exact supremum `radius * sigma_max(A^t)` of a system that is linear in its state.
    Exact,
}

/// Lipschitz constants of the margins: computed from the system, or given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConstantSettings {
    /// `L_r`; computed if absent.
    pub target: Option<f64>,
    /// `L_c`; computed if absent.
    pub constraint: Option<f64>,
    /// Where they are to hold.
    pub region: ConstantRegion,
    /// What is confirmed of the margins.
    pub assume: Vec<Assumption>,
}

/// Where the Lipschitz constants are computed, section 4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ConstantRegion {
    /// On the hull of the states that pilot rollouts visit, widened.
    #[default]
    Visited,
    /// On the box of starts, which rollouts may leave: certificates before schema 3.
    Box,
}

/// The deviation bound, section 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationSettings {
    /// Radius of the ball around each nominal start.
    pub radius: f32,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Pairs N.
    pub scenarios: u64,
    /// Pairs of the pilot that fixes the shape.
    pub pilot: u64,
    /// Joint statement over the steps.
    pub joint: Joint,
    /// How the perturbed rollout is driven.
    pub control: PairControl,
    /// Which bound tightens the margins.
    pub source: DeviationSource,
}

/// The certified set and its conditional failure, sections 4 and 8.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalSettings {
    /// Pairs drawn from the box.
    pub draws: u64,
    /// One minus the confidence of the conditional failure bound, and again of the interval of
    /// the certified share.
    pub beta: f64,
}

/// One axis of the slice.
#[derive(Clone, Debug, PartialEq)]
pub struct SliceAxis {
    /// Index of the state.
    pub state: usize,
    /// Its values, ascending.
    pub values: Vec<f32>,
}

/// Where the ball of local growth is centred, section 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundarySearch {
    /// A boundary cell of the slice, cells ahead of the velocity preferred, as in the study.
    Slice,
    /// The nearest crossing along many directions in the coordinates that vary, by bisection.
    Rays,
}

/// Local growth, section 5 and Algorithm 1.
#[derive(Clone, Debug, PartialEq)]
pub struct GrowthSettings {
    /// The largest radius, `r_max`: the first of Algorithm 1, the last of growth upward.
    pub radius: f32,
    /// Rounds M.
    pub rounds: u32,
    /// Starts N of each round.
    pub scenarios: u64,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence, over all rounds.
    pub beta: f64,
    /// Whether beta is divided by the rounds, as soundness asks (section 8.2).
    pub split_beta: bool,
    /// The coordinates that vary; the others keep the values of the state.
    pub varies: Vec<bool>,
    /// Where the centre is looked for.
    pub boundary: BoundarySearch,
    /// The two coordinates whose velocity says what is ahead, and their velocities: the slice
    /// search of the study prefers cells there. Indices `[x, vx, y, vy]`.
    pub heading: Option<[usize; 4]>,
    /// Which way radii go, and what grows.
    pub plan: GrowthPlan,
}

/// Everything that `certify` needs to know beside the plant and the backend.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Seed of every stream.
    pub seed: u64,
    /// Horizon and discount.
    pub spec: RolloutSpec,
    /// Lower corner of the box of nominal starts.
    pub low: Vec<f32>,
    /// Upper corner.
    pub high: Vec<f32>,
    /// Lipschitz constants.
    pub constants: ConstantSettings,
    /// Deviation bound.
    pub deviation: DeviationSettings,
    /// Certified set.
    pub global: GlobalSettings,
    /// The whole box; nothing is said of it where there are none.
    pub whole_box: Option<BoxSettings>,
    /// Margin drops, where these tighten the margins and not constants times the deviation bound.
    pub drops: Option<DropSettings>,
    /// How the ball of the deviation bound around a start is enclosed, where that certifies it and no margins
    /// are tightened.
    pub enclosed: Option<Kind>,
    /// The deterministic certificate, where there is to be one.
    pub deterministic: Option<DeterministicSettings>,
    /// The slice: the axis across the columns, then the axis along the rows; none where there is but
    /// one state.
    pub slice: Option<[SliceAxis; 2]>,
    /// The state that the slice, the boundary search and the growth start from.
    pub state: Vec<f32>,
    /// Local growth.
    pub growth: GrowthSettings,
    /// A claim whose starts are looked at one after the other, where one is asked for.
    pub sequential: Option<SequentialSettings>,
    /// Number of the attempt that the betas are booked for; none of a certificate that counts as the only
    /// one. Set by [`Settings::as_attempt`].
    pub attempt: Option<u32>,
    /// Where the key of the streams that claims rest on comes from.
    pub keys: Keys,
}

/// Risk, beta and decision variables of each scenario program of a joint method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Program {
    /// Decision variables d.
    pub(crate) decision_vars: u32,
    /// Risk of one program.
    pub(crate) epsilon: f64,
    /// Beta of one program.
    pub(crate) beta: f64,
}

impl Program {
    /// The program that `joint` makes of the deviation bound over `horizon` steps; the bound of
    /// step 0 is the radius itself and costs nothing.
    pub(crate) fn new(settings: &DeviationSettings, horizon: u32) -> Self {
        let DeviationSettings { epsilon, beta, joint, .. } = *settings;
        let steps = f64::from(horizon);
        match joint {
            Joint::FixedShape | Joint::Separate => Self { decision_vars: 1, epsilon, beta },
            Joint::Variables => Self { decision_vars: horizon, epsilon, beta },
            Joint::Bonferroni => {
                Self { decision_vars: 1, epsilon: epsilon / steps, beta: beta / steps }
            }
        }
    }
}

impl Settings {
    /// The scenarios that `rule` asks for: pairs of the deviation bound, starts of a round of growth.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a risk or a beta that no count supports.
    pub fn scenario_counts(&self, rule: CountRule) -> Result<[u64; 2]> {
        let Program { decision_vars, epsilon, beta } =
            Program::new(&self.deviation, self.spec.horizon);
        let growth = &self.growth;
        Ok([
            rule.scenarios(epsilon, beta, decision_vars)?,
            rule.scenarios(growth.epsilon, growth.round_beta(), 1)?,
        ])
    }

    /// Whether `state` lies in the box, outside of which no claim speaks.
    pub fn in_box(&self, state: &[f32]) -> bool {
        (0..state.len()).all(|i| self.low[i] <= state[i] && state[i] <= self.high[i])
    }

    /// Columns and rows of the slice; none of both where there is no slice.
    pub(crate) fn slice_size(&self) -> [usize; 2] {
        self.slice.as_ref().map_or([0, 0], |axes| axes.each_ref().map(|axis| axis.values.len()))
    }

    /// Sound settings for `model` around `state`, to be adjusted field by field: risk 0.1 and
    /// beta 1e-3 throughout, computed constants, a joint deviation bound of radius 0.05 by fixed
    /// shape under replayed controls, 20,000 draws, a slice of 21 by 21 cells over the first two
    /// states, growth in all coordinates from radius 0.5 in at most 10 rounds with beta split.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `state` has not a number for each state of the model.
    pub fn new(model: &Model, state: impl Into<Vec<f32>>, spec: RolloutSpec) -> Result<Self> {
        let (axes, state) = (&model.states, state.into());
        if state.len() != axes.len() {
            let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            let problem = format!(
                "{} numbers, the model `{}` has {} states: {}",
                state.len(),
                model.name,
                axes.len(),
                names.join(", ")
            );
            return Err(Error::invalid("state", problem));
        }
        let (epsilon, beta, scenarios) = (0.1, 1e-3, 159);
        let slice = (axes.len() > 1).then_some([0, 1]).map(|both| {
            both.map(|state| {
                let step = (axes[state].high - axes[state].low) / f32::from(SLICE_CELLS - 1);
                let value = |i| axes[state].low + f32::from(i) * step;
                SliceAxis { state, values: (0..SLICE_CELLS).map(value).collect() }
            })
        });
        Ok(Self {
            seed: 1,
            spec,
            low: axes.iter().map(|axis| axis.low).collect(),
            high: axes.iter().map(|axis| axis.high).collect(),
            constants: ConstantSettings::default(),
            deviation: DeviationSettings {
                radius: 0.05,
                epsilon,
                beta,
                scenarios,
                pilot: scenarios,
                joint: Joint::FixedShape,
                control: PairControl::Replay,
                source: DeviationSource::Scenario,
            },
            global: GlobalSettings { draws: 20_000, beta },
            whole_box: Some(BoxSettings { risk: None, beta }),
            drops: None,
            enclosed: None,
            deterministic: None,
            slice,
            state,
            growth: GrowthSettings {
                radius: 0.5,
                rounds: 10,
                scenarios,
                epsilon,
                beta,
                split_beta: true,
                varies: vec![true; axes.len()],
                boundary: BoundarySearch::Rays,
                heading: None,
                plan: GrowthPlan::SHRINKING,
            },
            sequential: None,
            attempt: None,
            keys: Keys::Claim,
        })
    }
}
