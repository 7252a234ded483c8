//! The settings of the race experiment: the `[race]` section of a configuration.

use serde::{Deserialize, Serialize};

use super::judge::Judge;
use crate::control::tier::Domain;
use crate::error::{Error, Result};
use crate::race::barrier::{BarrierFilter, BarrierForm, Widening};
use crate::race::cost::{QuadraticCost, RaceCost};
use crate::race::system::DroneRace;
use crate::rollout::{MppiSettings, MppiSpec, NoiseKind, Sigma};
use crate::scenario::growth_plan::GrowthMethod;
use crate::system::System;

/// Most control steps of a race: each has random streams of its own.
const MOST_STEPS: u32 = 10_000;

/// Most improvements of a plan at each control step: more is a slip.
const MOST_ITERATIONS: u32 = 1000;

/// Ego gain of the rollouts that the study's plans start from, m/s^2.
pub const STUDY_PLAN_GAIN: f32 = 2.0;
/// The study's weights of recovery: position, velocity, control.
pub const STUDY_RECOVERY: [f32; 3] = [5.0, 1.0, 0.1];
/// The study's weight of the value term.
pub const STUDY_VALUE_WEIGHT: f32 = 1e6;

/// Everything about a race but the plant, the policy and the certificates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RaceSettings {
    /// Longest race, control steps of 0.1 s.
    pub steps: u32,
    /// The judge whose successes the metrics average.
    pub judge: Judge,
    /// What each race may spend on local growth, of confidence.
    pub beta: f64,
    /// The starts, a file relative to the configuration's.
    pub starts: String,
    /// Interval of each state for starts that are drawn, in state order, m and m/s.
    pub start_box: Vec<[f64; 2]>,
    /// Networks beside the policy, files relative to the configuration's; empty for none.
    pub networks: NetworkFiles,
    /// The four tiers.
    pub hybrid: HybridSettings,
    /// The ablation without the policy.
    pub no_policy: NoPolicySettings,
    /// MPPI alone.
    pub mppi: PlanSettings,
    /// MPPI with a soft safety cost.
    pub soft: PlanSettings,
    /// MPPI before the barrier filter.
    pub cbf: PlanSettings,
    /// MPPI warm-started with the policy.
    pub warmstart: PlanSettings,
    /// Whether the warm start is there; the published one was zeroed before its first use.
    pub warmstart_works: bool,
    /// The barrier filter.
    pub filter: FilterSettings,
}

/// Files of networks, relative to the configuration's; empty for none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFiles {
    /// The value network of the recovery tier.
    pub value: String,
    /// The disturbance of the opponent in recovery rollouts, one output per axis.
    pub disturbance: String,
    /// The policy of `ppo-cbf`.
    pub ppo: String,
}

/// The hierarchical controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HybridSettings {
    /// Whether tier 1, the certified set, is used.
    pub global: bool,
    /// Where tier 1 may hold.
    pub domain: Domain,
    /// Whether tier 2, the locally verified ball, is used.
    pub local: bool,
    /// How the ball of tier 2 is looked for, whatever `growth.method` a certificate has.
    #[serde(default)]
    pub growth: GrowthMethod,
    /// Whether tier 3, recovery, is used; without it the policy flies there too.
    pub recovery_tier: bool,
    /// Whether the target, once reached, counts as held.
    pub latch: bool,
    /// Whether the fast plan takes over within 0.1 m of the gate.
    pub near_gate: bool,
    /// Speed toward the gate that the fast plan keeps there, m/s.
    pub near_gate_speed: f32,
    /// What the first plan in the target is.
    pub first_plan: FirstPlan,
    /// Where recovery steers to.
    pub recovery_point: RecoveryPoint,
    /// Ego gain of the policy's rollouts that plans start from, m/s^2: 2.0 in the study, against
    /// 0.5 of its plant; 0 for the plant's own.
    pub plan_gain: f32,
    /// Whether the opponent stays where it is in these rollouts, as in the study.
    pub hold_opponent: bool,
    /// Weight of the value term of recovery.
    pub value_weight: f32,
    /// Value below which it costs.
    pub value_threshold: f32,
    /// Tier 3.
    pub recovery: PlanSettings,
    /// Tier 0.
    pub fast: PlanSettings,
}

/// What the first plan in the target is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstPlan {
    /// No control.
    Zero,
    /// The study's: against the velocity across where that is above 0.35 m/s, else none.
    Brake,
    /// A rollout of the policy.
    Policy,
}

/// Where recovery steers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RecoveryPoint {
    /// The study's: the nearest point of the verified ball, else the nearest certified cell of
    /// the slice, else the gate.
    Verified,
    /// The state that the policy's rollout comes to at the end of the plan.
    Policy,
    /// The gate.
    Gate,
}

/// The ablation without policy and certificates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoPolicySettings {
    /// Outside of the target.
    pub recovery: PlanSettings,
    /// In the target.
    pub fast: PlanSettings,
}

/// How a plan is improved at each control step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanSettings {
    /// Samples K.
    pub samples: u32,
    /// Steps H of the plan.
    pub horizon: u32,
    /// Temperature lambda, in units of cost.
    pub temperature: f32,
    /// Standard deviation of the noise: one number, one per control, or the covariance matrix.
    pub sigma: SigmaSetting,
    /// Improvements at each control step.
    pub iterations: u32,
    /// How the noise hangs together over the steps.
    pub noise: NoiseKind,
    /// Whether samples come in mirrored pairs.
    pub antithetic: bool,
    /// Whether samples pay for their noise.
    pub noise_cost: bool,
    /// Speed toward the gate to keep, m/s.
    pub speed: f32,
    /// The cost.
    pub cost: RaceCost,
}

/// Standard deviation of the noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, three numbers or a 3 x 3 matrix")]
pub enum SigmaSetting {
    /// The same for each control.
    Same(f32),
    /// One for each control.
    PerControl([f32; 3]),
    /// The covariance matrix.
    Covariance([[f32; 3]; 3]),
}

/// The barrier filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilterSettings {
    /// Steps ahead that the barrier is kept.
    pub form: BarrierForm,
    /// What widens the radius.
    pub widening: Widening,
    /// Share of the barrier that may be given up in one step, in (0, 1].
    pub rate: f64,
    /// Weight of the squared slack.
    pub slack_weight: f64,
    /// Distance kept to the opponent, m.
    pub radius: f64,
}

impl RaceSettings {
    /// Refuses what some controller could not race with, whether it is asked for or not.
    ///
    /// # Errors
    /// [`Error::Invalid`] for steps, a beta or a gain out of range, and those of [`PlanSettings::spec`]
    /// and [`FilterSettings::filter`].
    pub fn check(&self, system: &DroneRace) -> Result<()> {
        let Self { steps, beta, .. } = *self;
        if !(1..=MOST_STEPS).contains(&steps) {
            let problem = format!("{steps} is not within 1..={MOST_STEPS}");
            return Err(Error::invalid("race.steps", problem));
        }
        if !(beta > 0.0 && beta < 1.0) {
            let problem = format!("{beta} is not strictly between 0 and 1");
            return Err(Error::invalid("race.beta", problem));
        }
        let gain = self.hybrid.plan_gain;
        if gain < 0.0 {
            let problem = format!("{gain} is below 0; 0 takes the plant's own gain");
            return Err(Error::invalid("race.hybrid.plan_gain", problem));
        }
        for (section, plan) in self.plans() {
            plan.spec(section, system)?;
            check_obstacle(section, &plan.cost)?;
        }
        self.filter.filter().map(|_| ())
    }

    /// The plans of all controllers by their sections.
    fn plans(&self) -> [(&'static str, &PlanSettings); 8] {
        [
            ("race.hybrid.recovery", &self.hybrid.recovery),
            ("race.hybrid.fast", &self.hybrid.fast),
            ("race.no_policy.recovery", &self.no_policy.recovery),
            ("race.no_policy.fast", &self.no_policy.fast),
            ("race.mppi", &self.mppi),
            ("race.soft", &self.soft),
            ("race.cbf", &self.cbf),
            ("race.warmstart", &self.warmstart),
        ]
    }
}

/// Refuses an obstacle in the plane of a state that there is not.
fn check_obstacle(section: &str, cost: &RaceCost) -> Result<()> {
    let RaceCost::Quadratic(QuadraticCost { obstacle: Some(obstacle), .. }) = cost else {
        return Ok(());
    };
    match obstacle.states.iter().find(|state| **state >= 12) {
        None => Ok(()),
        Some(state) => {
            let key = format!("{section}.cost.obstacle.states");
            Err(Error::invalid(key, format!("{state} is no state; there are 0 to 11")))
        }
    }
}

impl PlanSettings {
    /// Steps of samples of all improvements at one control step.
    pub(super) fn work(&self) -> f64 {
        f64::from(self.samples) * f64::from(self.horizon) * f64::from(self.iterations)
    }

    /// The checked settings, errors naming the key under `section`.
    ///
    /// # Errors
    /// [`Error::Invalid`], as [`MppiSpec::new`], and for no iteration.
    pub fn spec(&self, section: &str, system: &DroneRace) -> Result<MppiSpec> {
        if self.iterations > MOST_ITERATIONS {
            let problem = format!(
                "{} improvements of a plan at each control step, at most {MOST_ITERATIONS}; more \
                 `samples` take part at once",
                self.iterations
            );
            return Err(Error::invalid(format!("{section}.iterations"), problem));
        }
        if self.iterations == 0 {
            let problem = "0; expected 1 or more";
            return Err(Error::invalid(format!("{section}.iterations"), problem));
        }
        let settings = MppiSettings {
            samples: self.samples,
            horizon: self.horizon,
            temperature: self.temperature,
            sigma: match self.sigma {
                SigmaSetting::Same(sigma) => Sigma::PerControl(vec![sigma; 3]),
                SigmaSetting::PerControl(sigma) => Sigma::PerControl(sigma.to_vec()),
                SigmaSetting::Covariance(matrix) => {
                    Sigma::Covariance(matrix.map(|row| row.to_vec()).to_vec())
                }
            },
            noise: self.noise,
            antithetic: self.antithetic,
            noise_cost: self.noise_cost,
            bounds: system.controls().map(|axis| [axis.low, axis.high]).to_vec(),
        };
        MppiSpec::new(settings).map_err(|error| match error {
            Error::Invalid { place, problem } => {
                Error::invalid(format!("{section}.{place}"), problem)
            }
            other => other,
        })
    }
}

impl FilterSettings {
    /// The filter.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a rate outside (0, 1], or a weight or radius that is not positive.
    pub fn filter(&self) -> Result<BarrierFilter> {
        let Self { form, widening, rate, slack_weight, radius } = *self;
        if !(rate > 0.0 && rate <= 1.0) {
            return Err(Error::invalid("race.filter.rate", format!("{rate} is outside (0, 1]")));
        }
        for (key, value) in [("slack_weight", slack_weight), ("radius", radius)] {
            if !(value > 0.0 && value.is_finite()) {
                let problem = format!("{value} is not a positive number");
                return Err(Error::invalid(format!("race.filter.{key}"), problem));
            }
        }
        Ok(BarrierFilter { form, widening, rate, slack_weight, radius })
    }
}
