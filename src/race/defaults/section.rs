//! The section `[race]` of each profile.

use crate::config::Profile;
use crate::control::tier::Domain;
use crate::race::barrier::BarrierFilter;
use crate::race::cost::{
    CenterlineCost, Fence, LaneCost, RaceCost, RecoveryCost, Safety, SafetyCone,
};
use crate::race::judge::Judge;
use crate::race::settings::{
    FilterSettings, FirstPlan, HybridSettings, NetworkFiles, NoPolicySettings, PlanSettings,
    RaceSettings, RecoveryPoint, STUDY_PLAN_GAIN, STUDY_RECOVERY, STUDY_VALUE_WEIGHT, SigmaSetting,
};
use crate::rollout::NoiseKind;
use crate::scenario::growth_plan::GrowthMethod;

/// Improvements of the fast plan, and of MPPI alone, at each control step in `rigorous`.
const FAST_ITERATIONS: u32 = 3;
/// The safety term of `rigorous`.
const SAFETY: Safety =
    Safety { weight: 1e6, margin: 0.05, cone: SafetyCone::Either, ..Safety::NONE };
/// The fence term of `rigorous`.
const FENCE: Fence = Fence { weight: 1e6, margin: 0.03 };

/// The `[race]` section of `profile`. Where the paper gives no number, `paper` has the study's.
pub(super) fn race(profile: Profile) -> RaceSettings {
    let rigorous = profile == Profile::Rigorous;
    RaceSettings {
        steps: 80,
        judge: match profile {
            Profile::Paper => Judge::Paper,
            Profile::Study => Judge::Study,
            Profile::Rigorous => Judge::Rigorous,
        },
        // Room for eighty calls of local growth as published; ours spend less.
        beta: if rigorous { 0.1 } else { 0.999 },
        starts: "race_starts_500.csv".to_owned(),
        start_box: start_box(),
        networks: NetworkFiles {
            value: "policies/race_value.safetensors".to_owned(),
            ..NetworkFiles::default()
        },
        hybrid: if rigorous { rigorous_hybrid() } else { study_hybrid() },
        no_policy: if rigorous { rigorous_no_policy() } else { study_no_policy() },
        mppi: alone(rigorous, 25, Safety::NONE),
        soft: alone(rigorous, 25, soft(if rigorous { 1e6 } else { 10.0 })),
        cbf: alone(rigorous, if rigorous { 25 } else { 20 }, Safety::NONE),
        warmstart: alone(rigorous, 25, Safety::NONE),
        warmstart_works: rigorous,
        filter: filter(rigorous),
    }
}

/// MPPI alone: with as many improvements of a plan as the hybrid's in `rigorous`, one as published.
fn alone(rigorous: bool, horizon: u32, safety: Safety) -> PlanSettings {
    let iterations = if rigorous { FAST_ITERATIONS } else { 1 };
    PlanSettings { iterations, ..plan(horizon, 0.7, lane(2.0, safety)) }
}

/// The ablation without the policy as published.
fn study_no_policy() -> NoPolicySettings {
    NoPolicySettings {
        recovery: plan(20, 0.7, centerline(1.0, soft(10.0))),
        fast: plan(20, 0.5, lane(0.5, soft(5.0))),
    }
}

/// The same with the terms and the improvements of the hybrid, so that the policy and what needs
/// it are all that is missing.
fn rigorous_no_policy() -> NoPolicySettings {
    let hybrid = rigorous_hybrid();
    let outside = match centerline(1.0, SAFETY) {
        RaceCost::Centerline(cost) => RaceCost::Centerline(CenterlineCost { fence: FENCE, ..cost }),
        other => other,
    };
    let recovery = PlanSettings { cost: outside, ..hybrid.recovery };
    NoPolicySettings { recovery, fast: hybrid.fast }
}

/// Where the study's starts were drawn from.
fn start_box() -> Vec<[f64; 2]> {
    let drone = |speed| [[-0.8, 0.8], [0.0, 0.0], [-2.5, -1.0], speed, [-0.1, 0.1], [-0.1, 0.1]];
    [drone([0.5, 0.7]), drone([0.3, 0.5])].concat()
}

/// The filter: as published, or with authority over the plant.
fn filter(rigorous: bool) -> FilterSettings {
    let filter = if rigorous { BarrierFilter::RIGOROUS } else { BarrierFilter::STUDY };
    let BarrierFilter { form, widening, rate, slack_weight, radius } = filter;
    FilterSettings { form, widening, rate, slack_weight, radius }
}

/// The hybrid as the published code has it.
fn study_hybrid() -> HybridSettings {
    HybridSettings {
        global: true,
        domain: Domain::Anywhere,
        local: true,
        growth: GrowthMethod::Shrinking,
        recovery_tier: true,
        latch: true,
        near_gate: true,
        near_gate_speed: 0.7,
        first_plan: FirstPlan::Brake,
        recovery_point: RecoveryPoint::Verified,
        plan_gain: STUDY_PLAN_GAIN,
        hold_opponent: true,
        value_weight: STUDY_VALUE_WEIGHT,
        value_threshold: -0.02,
        recovery: plan(20, 0.7, recovery(soft(5.0), Fence::NONE)),
        fast: plan(20, 0.5, lane(0.5, Safety::NONE)),
    }
}

/// The hybrid with safety and fences in both plans, plans that start from the plant's own model
/// and are improved several times, and a recovery that follows the policy: each of these is
/// measured in the README.
fn rigorous_hybrid() -> HybridSettings {
    let (safety, fence) = (SAFETY, FENCE);
    let follow = RecoveryCost { position: 20.0, velocity: 10.0, control: 1e-3, safety, fence };
    let with_fence = |cost: RaceCost| match cost {
        RaceCost::Lane(cost) => RaceCost::Lane(LaneCost { fence, ..cost }),
        other => other,
    };
    HybridSettings {
        domain: Domain::Box,
        plan_gain: 0.0,
        hold_opponent: false,
        recovery_point: RecoveryPoint::Policy,
        value_weight: 0.0,
        recovery: PlanSettings { iterations: 4, ..plan(20, 0.7, RaceCost::Recovery(follow)) },
        fast: PlanSettings {
            iterations: FAST_ITERATIONS,
            ..plan(20, 0.5, with_fence(lane(0.5, safety)))
        },
        ..study_hybrid()
    }
}

/// A safety term as published: from the cone on.
fn soft(weight: f32) -> Safety {
    Safety { weight, ..Safety::NONE }
}

/// The study's sampling: sigma 0.4, lambda 10, K = 500.
fn plan(horizon: u32, speed: f32, cost: RaceCost) -> PlanSettings {
    PlanSettings {
        samples: 500,
        horizon,
        temperature: 10.0,
        sigma: SigmaSetting::Same(0.4),
        iterations: 1,
        noise: NoiseKind::Independent,
        antithetic: false,
        noise_cost: false,
        speed,
        cost,
    }
}

/// Family A.
fn recovery(safety: Safety, fence: Fence) -> RaceCost {
    let [position, velocity, control] = STUDY_RECOVERY;
    RaceCost::Recovery(RecoveryCost { position, velocity, control, safety, fence })
}

/// Family A'.
fn centerline(speed: f32, safety: Safety) -> RaceCost {
    let fence = Fence::NONE;
    RaceCost::Centerline(CenterlineCost { lane: 25e3, speed, control: 0.01, safety, fence })
}

/// Family B.
fn lane(speed: f32, safety: Safety) -> RaceCost {
    RaceCost::Lane(LaneCost {
        lane: 25e3,
        speed,
        control: 1e-3,
        away: 5e4,
        wide: 5e4,
        last: 1e4,
        safety,
        fence: Fence::NONE,
    })
}
