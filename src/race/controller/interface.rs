//! Controllers by name, and what all of them have in common.

use serde::{Deserialize, Serialize};

use crate::backend::{Backend, Program};
use crate::control::tier::LocalGrowth;
use crate::error::Result;
use crate::policy::Mlp;
use crate::race::barrier::FilterStatus;
use crate::race::settings::RaceSettings;
use crate::race::system::DroneRace;
use crate::scenario::settings::Settings;
use crate::scenario::tier::Tier;

/// The controllers of the study, and the hybrid with a part left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Name {
    /// The four tiers.
    Hybrid,
    /// The hybrid without policy and certificates.
    HybridNoPolicy,
    /// MPPI alone.
    Mppi,
    /// MPPI with a soft safety cost.
    MppiSoft,
    /// MPPI before the barrier filter.
    MppiCbf,
    /// MPPI warm-started with the policy.
    MppiWarmstart,
    /// The policy alone.
    Policy,
    /// A policy trained by PPO, before the barrier filter.
    PpoCbf,
    /// The hybrid without tier 1.
    HybridNoGlobal,
    /// The hybrid without tier 2.
    HybridNoLocal,
    /// The hybrid without tier 3: the policy flies there.
    HybridNoRecovery,
    /// The hybrid without safety terms.
    HybridNoSafety,
    /// The hybrid without fence terms.
    HybridNoFences,
    /// The hybrid with one improvement of a plan per control step.
    HybridOneIteration,
    /// The hybrid whose plans start from the study's rollouts.
    HybridStudyStart,
    /// The hybrid with the study's recovery point and weights.
    HybridStudyRecovery,
    /// The hybrid with the value term in recovery.
    HybridValue,
}

impl Name {
    /// All of them.
    pub const ALL: [Self; 17] = [
        Self::Hybrid,
        Self::HybridNoPolicy,
        Self::Mppi,
        Self::MppiSoft,
        Self::MppiCbf,
        Self::MppiWarmstart,
        Self::Policy,
        Self::PpoCbf,
        Self::HybridNoGlobal,
        Self::HybridNoLocal,
        Self::HybridNoRecovery,
        Self::HybridNoSafety,
        Self::HybridNoFences,
        Self::HybridOneIteration,
        Self::HybridStudyStart,
        Self::HybridStudyRecovery,
        Self::HybridValue,
    ];

    /// The eight controllers of the study.
    pub const STUDY: [Self; 8] = [
        Self::Hybrid,
        Self::HybridNoPolicy,
        Self::Mppi,
        Self::MppiSoft,
        Self::MppiCbf,
        Self::MppiWarmstart,
        Self::Policy,
        Self::PpoCbf,
    ];
    /// The hybrid, and what it is where one thing is as in the study.
    pub const IMPROVEMENTS: [Self; 7] = [
        Self::Hybrid,
        Self::HybridNoSafety,
        Self::HybridNoFences,
        Self::HybridOneIteration,
        Self::HybridStudyStart,
        Self::HybridStudyRecovery,
        Self::HybridValue,
    ];
    /// The hybrid and what it is without each of its parts.
    pub const ABLATIONS: [Self; 6] = [
        Self::Hybrid,
        Self::HybridNoGlobal,
        Self::HybridNoLocal,
        Self::HybridNoRecovery,
        Self::HybridNoPolicy,
        Self::HybridNoSafety,
    ];

    /// The name on the command line.
    pub fn text(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::HybridNoPolicy => "hybrid-no-policy",
            Self::Mppi => "mppi",
            Self::MppiSoft => "mppi-soft",
            Self::MppiCbf => "mppi-cbf",
            Self::MppiWarmstart => "mppi-warmstart",
            Self::Policy => "policy",
            Self::PpoCbf => "ppo-cbf",
            Self::HybridNoGlobal => "hybrid-no-global",
            Self::HybridNoLocal => "hybrid-no-local",
            Self::HybridNoRecovery => "hybrid-no-recovery",
            Self::HybridNoSafety => "hybrid-no-safety",
            Self::HybridNoFences => "hybrid-no-fences",
            Self::HybridOneIteration => "hybrid-one-iteration",
            Self::HybridStudyStart => "hybrid-study-start",
            Self::HybridStudyRecovery => "hybrid-study-recovery",
            Self::HybridValue => "hybrid-value",
        }
    }

    /// The sections of a configuration whose plans it improves; empty without plans.
    pub fn plan_sections(self) -> &'static [&'static str] {
        match self {
            Self::Mppi => &["race.mppi"],
            Self::MppiSoft => &["race.soft"],
            Self::MppiCbf => &["race.cbf"],
            Self::MppiWarmstart => &["race.warmstart"],
            Self::HybridNoPolicy => &["race.no_policy.recovery", "race.no_policy.fast"],
            Self::Policy | Self::PpoCbf => &[],
            // The hybrid, whole or with a part changed.
            _ => &["race.hybrid.recovery", "race.hybrid.fast"],
        }
    }

    /// What it is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Hybrid => {
                "The four tiers: fast MPPI in the target, the policy where a \
                             certificate covers the state, recovery MPPI elsewhere."
            }
            Self::HybridNoPolicy => {
                "Fast MPPI in the target and MPPI elsewhere, without policy, \
                                     value and certificates."
            }
            Self::Mppi => "MPPI alone, without any term for safety.",
            Self::MppiSoft => "MPPI with a soft safety cost.",
            Self::MppiCbf => "MPPI whose control passes the barrier filter.",
            Self::MppiWarmstart => {
                "MPPI whose plan starts from a rollout of the policy at each \
                                    step; as published it is zeroed before its first use."
            }
            Self::Policy => "The reachability policy alone.",
            Self::PpoCbf => "A policy trained by PPO, its control passed through the filter.",
            Self::HybridNoGlobal => "The hybrid without tier 1, the certified set.",
            Self::HybridNoLocal => "The hybrid without tier 2, the locally verified ball.",
            Self::HybridNoRecovery => "The hybrid without tier 3: the policy flies there too.",
            Self::HybridNoSafety => "The hybrid without safety terms in its costs.",
            Self::HybridNoFences => "The hybrid without fence terms in its costs.",
            Self::HybridOneIteration => "The hybrid with one improvement of a plan per step.",
            Self::HybridStudyStart => {
                "The hybrid whose plans start from rollouts with the study's \
                                       ego gain of 2.0 and an opponent that stays in place."
            }
            Self::HybridStudyRecovery => {
                "The hybrid with both the study's recovery point and its \
                                          weights."
            }
            Self::HybridValue => "The hybrid with the study's value term in recovery.",
        }
    }
}

/// What controllers are made of.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// Who runs the rollouts.
    pub backend: &'a Backend,
    /// The plant under the reachability policy, prepared.
    pub program: &'a Program<'a>,
    /// The plant.
    pub system: &'a DroneRace,
    /// The reachability policy.
    pub policy: &'a Mlp,
    /// The value network, if there is one.
    pub value: Option<&'a Mlp>,
    /// The disturbance network, if there is one.
    pub disturbance: Option<&'a Mlp>,
    /// The policy of `ppo-cbf`, if there is one.
    pub ppo: Option<&'a Mlp>,
    /// The race.
    pub race: &'a RaceSettings,
    /// The certificates.
    pub certificates: &'a Settings,
}

/// A race under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Active {
    /// Its place in the batch.
    pub place: usize,
    /// Seed of its random numbers.
    pub seed: u64,
    /// The state now.
    pub state: [f32; 12],
}

/// What a controller does at one step of one race, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decision {
    /// The control, within its bounds.
    pub control: [f32; 3],
    /// The tier, for controllers that have tiers.
    pub tier: Option<Tier>,
    /// `V_check`, where it was computed.
    pub check_margin: Option<f32>,
    /// The ball of local growth, where one was grown.
    pub growth: Option<LocalGrowth>,
    /// The certified cells of the slice, where they were computed.
    pub certified: Vec<bool>,
    /// The point that recovery steers to.
    pub recovery: Option<[f32; 3]>,
    /// Effective samples of the plan, where there is one.
    pub effective_samples: Option<f64>,
    /// Smallest cost that a sample of the plan achieved, where there is one.
    pub best_cost: Option<f32>,
    /// Sampled paths of the ego in x and y, where they were asked for.
    pub fan: Vec<Vec<[f32; 2]>>,
    /// Samples of the plan whose cost is not finite.
    pub non_finite: u32,
    /// Whether growth was not called because no beta was left.
    pub refused: bool,
    /// What the filter did, where there is one.
    pub filter: Option<FilterLog>,
    /// Beta spent at this step.
    pub beta: f64,
    /// Share of this race in the wall time of the batches that decided it, s.
    pub seconds: f64,
}

/// What the filter did at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterLog {
    /// How it came to its control.
    pub status: FilterStatus,
    /// How far the barrier was relaxed, m^2.
    pub slack: f64,
    /// Whether it changed the control by more than 1e-6.
    pub active: bool,
}

/// A controller of all races of a batch.
pub trait Controller {
    /// The controls of the races that are under way, in their order, at control step `step`.
    ///
    /// # Errors
    /// Those of the backend.
    fn decide(&mut self, step: u32, active: &[Active]) -> Result<Vec<Decision>>;
}
