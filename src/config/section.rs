//! The sections of a configuration, with the meaning and unit of each key.

use serde::{Deserialize, Serialize};

use super::deterministic::DeterministicSection;
use super::drops::{CalibrationSection, DropsSection, TighteningSource, share_draws};
use super::named_system::NamedSystem;
use super::registry::Registry;
use super::sequential::SequentialSection;
use super::sources::Sources;
use super::value::{Constant, Coordinates, Named};
use crate::error::{Error, Result};
use crate::model::text::NetworkFile;
use crate::plan::PlanSettings;
use crate::rollout::PairControl;
use crate::scenario::growth_plan::{Around, GrowthMethod, GrowthPlan, GrowthShape};
use crate::scenario::record::Assumption;
use crate::scenario::settings::{BoundarySearch, ConstantRegion, DeviationSource, Joint};
use crate::studies::StudySettings;
use crate::train::settings::TrainSettings;

/// Intervals by state name, in state order.
pub type BoxSection = Named<[f64; 2]>;
/// Numbers by state name, in state order.
pub type StateSection = Named<f64>;

/// A whole configuration, every default filled in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the defaults come from.
    pub profile: Profile,
    /// Seed of every random stream.
    pub seed: u64,
    /// Number of the attempt at these claims, from 1; none of a certificate that counts as the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempt: Option<u32>,
    /// The system and its parameters, where it is one that the program carries or registers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system: Option<NamedSystem>,
    /// The plant and its task as text (`docs/models.md`), where it is one of the user's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<toml::Table>,
    /// The networks that its formulas call, as they were read; no part of what is stored.
    #[serde(skip)]
    pub networks: Vec<NetworkFile>,
    /// The policy.
    pub policy: PolicySection,
    /// Length and discount of a rollout.
    pub rollout: RolloutSection,
    /// Interval of each state for nominal starts.
    #[serde(rename = "box")]
    pub bounds: BoxSection,
    /// Lipschitz constants of the margins.
    pub constants: ConstantsSection,
    /// The deviation bound.
    pub deviation: DeviationSection,
    /// The certified set and its conditional failure.
    pub global: GlobalSection,
    /// The bound on margin drops.
    #[serde(default)]
    pub drops: DropsSection,
    /// Calibration of the score.
    #[serde(default)]
    pub calibration: CalibrationSection,
    /// What is certified without samples.
    #[serde(default)]
    pub deterministic: DeterministicSection,
    /// The two coordinates of the slice.
    pub slice: SliceSection,
    /// The state that slice, boundary search and growth start from.
    pub state: StateSection,
    /// Local growth.
    pub growth: GrowthSection,
    /// A claim whose starts are looked at one after the other.
    #[serde(default)]
    pub sequential: SequentialSection,
    /// The experiments of a study; only the plants of studies have them. Files call them by their first.
    #[serde(default, rename = "race", skip_serializing_if = "Option::is_none")]
    pub study: Option<StudySettings>,
    /// Training; what a certificate or race stores of its configuration has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub train: Option<TrainSettings>,
    /// Plants that `system` may name beside the carried ones; no part of what is stored.
    #[serde(skip)]
    pub(super) registry: Registry,
    /// Plans in closed loop; what a certificate, a race or a training stores of its configuration has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanSettings>,
    /// Where the values were written; nowhere for a configuration that was stored.
    #[serde(skip)]
    pub(super) sources: Sources,
}

/// Which defaults fill in what a file leaves out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// The experiment as printed in the paper.
    Paper,
    /// The experiment as the authors' published code does it.
    Study,
    /// The same experiment with sound constants and accounting.
    #[default]
    Rigorous,
}

impl Profile {
    /// The name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Study => "study",
            Self::Rigorous => "rigorous",
        }
    }
}

/// The policy: a file or a formula.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicySection {
    /// Safetensors file, relative to the configuration file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Name of a formula: `bang-bang`, for the double integrator; for a model a formula for each
    /// control.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<FormulaSection>,
    /// What the network of a model sees, a formula for each of its inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observe: Option<Vec<String>>,
    /// The controls of a model from what its network says, a formula for each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub act: Option<toml::Table>,
}

/// A policy that is a formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a formula, or a section with a formula for each control"
)]
pub enum FormulaSection {
    /// One that the program carries, by name.
    Name(String),
    /// A formula for each control.
    Controls(toml::Table),
}

impl PolicySection {
    /// Refuses a section with both a file and a formula, or with neither unless it is `optional`.
    pub(super) fn check(&self, optional: bool) -> Result<()> {
        let problem = match (&self.file, &self.formula) {
            (None, None) if !optional => "no policy; give `file`, a safetensors file, or `formula`",
            (Some(_), Some(_)) => "both `file` and `formula` are given; keep one of them",
            _ => return Ok(()),
        };
        Err(Error::invalid("policy", problem))
    }
}

/// Length and discount of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutSection {
    /// Steps T.
    pub horizon: u32,
    /// Discount per step, in (0, 1].
    pub gamma: f64,
}

/// Lipschitz constants of the margins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantsSection {
    /// `L_r` of the target margin.
    pub target: Constant,
    /// `L_c` of the constraint margin.
    pub constraint: Constant,
    /// Where they are to hold; a configuration that was stored without it meant the box of starts.
    #[serde(default = "of_the_box")]
    pub region: ConstantRegion,
    /// What is confirmed of the margins: `continuous`, `hulled`.
    #[serde(default)]
    pub assume: Vec<Assumption>,
}

/// Where constants were computed before there was a choice.
fn of_the_box() -> ConstantRegion {
    ConstantRegion::Box
}

/// The deviation bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviationSection {
    /// Radius of the ball around each nominal start.
    pub radius: f64,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Pairs N.
    pub scenarios: u64,
    /// Pairs of the pilot that fixes the shape.
    pub pilot: u64,
    /// How the bounds of all steps hold together.
    pub joint: Joint,
    /// How the perturbed rollout is driven.
    pub control: PairControl,
    /// Which bound tightens the margins.
    pub source: DeviationSource,
}

/// The certified set and its conditional failure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlobalSection {
    /// Pairs drawn from the box.
    pub draws: u64,
    /// One minus the confidence of each of the statements, that about the whole box among them.
    pub beta: f64,
    /// Largest risk that a start of the whole box may fail with, where that is asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub box_risk: Option<f64>,
    /// What says that a start is certified: margins that are tightened, or an enclosure of the ball around it.
    #[serde(default)]
    pub tightening: TighteningSource,
    /// Conditional risk that the certified set is to have, by margin drops: a claim. 1 asks for none, and
    /// without the key the profile looks for the set of a risk, and reports that of the bound by itself
    /// where the draws are too few to show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub risk: Option<f64>,
    /// Fresh starts that estimate the share of sets by margin drops.
    #[serde(default = "share_draws")]
    pub share_draws: u64,
}

/// The two coordinates of the slice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceSection {
    /// Across the columns.
    pub x: SliceAxisSection,
    /// Along the rows.
    pub y: SliceAxisSection,
}

/// One coordinate of the slice: `from`, `from + step`, ... below `to`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceAxisSection {
    /// Name of the state.
    pub state: String,
    /// First value.
    pub from: f64,
    /// End, exclusive.
    pub to: f64,
    /// Distance of neighbours.
    pub step: f64,
}

/// Local growth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrowthSection {
    /// The largest radius: the first when shrinking, the last upward.
    pub radius: f64,
    /// Rounds M when shrinking, radii upward.
    pub rounds: u32,
    /// Starts N of each round.
    pub scenarios: u64,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence, over all rounds.
    pub beta: f64,
    /// Whether each round spends `beta / rounds`, as soundness asks.
    pub split_beta: bool,
    /// The coordinates that vary.
    pub coordinates: Coordinates,
    /// Where the centre is looked for.
    pub boundary: BoundarySearch,
    /// States `[x, vx, y, vy]` of the slice search that prefers cells ahead; empty for none.
    pub heading: Vec<String>,
    /// Whose boundary the centre lies on; what an older version stored, on that of the certified set.
    #[serde(default)]
    pub around: Around,
    /// Which way radii go; what an older version stored shrinks.
    #[serde(default)]
    pub method: GrowthMethod,
    /// What grows.
    #[serde(default)]
    pub shape: GrowthShape,
    /// Upward: each radius over the one before it.
    #[serde(default = "factor")]
    pub factor: f64,
    /// Starts of the pilot that fixes the axes of an ellipsoid or a box.
    #[serde(default = "pilot")]
    pub pilot: u64,
}

/// The factor of radii that nobody asked for.
fn factor() -> f64 {
    GrowthPlan::UPWARD.factor
}

/// The pilot that nobody asked for.
fn pilot() -> u64 {
    GrowthPlan::UPWARD.pilot
}
