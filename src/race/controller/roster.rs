//! From a name to a controller.

use super::baseline::{MppiController, PolicyController};
use super::hybrid::Hybrid;
use super::interface::{Controller, Name, World};
use super::no_policy::NoPolicy;
use super::plan::Paths;
use crate::error::{Error, Result};
use crate::race::cost::{Fence, RaceCost, Safety};
use crate::race::settings::{
    HybridSettings, RaceSettings, RecoveryPoint, STUDY_PLAN_GAIN, STUDY_RECOVERY,
    STUDY_VALUE_WEIGHT,
};

/// The settings of the race as the controller `name` has them.
pub(in crate::race) fn settings(name: Name, race: &RaceSettings) -> RaceSettings {
    let mut race = race.clone();
    let hybrid = &mut race.hybrid;
    match name {
        Name::HybridNoGlobal => hybrid.global = false,
        Name::HybridNoLocal => hybrid.local = false,
        Name::HybridNoRecovery => hybrid.recovery_tier = false,
        Name::HybridNoSafety => each_plan(hybrid, |cost| *terms(cost).0 = Safety::NONE),
        Name::HybridNoFences => each_plan(hybrid, |cost| *terms(cost).1 = Fence::NONE),
        Name::HybridOneIteration => (hybrid.recovery.iterations, hybrid.fast.iterations) = (1, 1),
        Name::HybridStudyStart => {
            (hybrid.plan_gain, hybrid.hold_opponent) = (STUDY_PLAN_GAIN, true);
        }
        Name::HybridStudyRecovery => {
            hybrid.recovery_point = RecoveryPoint::Verified;
            if let RaceCost::Recovery(cost) = &mut hybrid.recovery.cost {
                [cost.position, cost.velocity, cost.control] = STUDY_RECOVERY;
            }
        }
        Name::HybridValue => hybrid.value_weight = STUDY_VALUE_WEIGHT,
        _ => {}
    }
    race
}

/// Changes the cost of both plans.
fn each_plan(hybrid: &mut HybridSettings, change: impl Fn(&mut RaceCost)) {
    change(&mut hybrid.recovery.cost);
    change(&mut hybrid.fast.cost);
}

/// Safety and fence terms of a cost.
fn terms(cost: &mut RaceCost) -> (&mut Safety, &mut Fence) {
    match cost {
        RaceCost::Recovery(cost) => (&mut cost.safety, &mut cost.fence),
        RaceCost::Centerline(cost) => (&mut cost.safety, &mut cost.fence),
        RaceCost::Lane(cost) => (&mut cost.safety, &mut cost.fence),
        RaceCost::Quadratic(cost) => (&mut cost.safety, &mut cost.fence),
    }
}

/// Why `name` cannot run with what there is; none if it can.
pub(in crate::race) fn absent(name: Name, world: &World<'_>) -> Option<String> {
    if name == Name::PpoCbf && world.ppo.is_none() {
        let reason = "it needs a policy trained by PPO, and `race.networks.ppo` names no file";
        Some(reason.to_owned())
    } else if values(name, world.race) && world.value.is_none() {
        let reason = "its recovery has a value term, and `race.networks.value` names no file; name \
                      one, or set `race.hybrid.value_weight` to 0";
        Some(reason.to_owned())
    } else {
        None
    }
}

/// The controllers that use neither certificates nor the value network.
const ALONE: [Name; 7] = [
    Name::HybridNoPolicy,
    Name::Mppi,
    Name::MppiSoft,
    Name::MppiCbf,
    Name::MppiWarmstart,
    Name::Policy,
    Name::PpoCbf,
];

/// Whether `name` asks for certificates.
pub(in crate::race) fn certifies(name: Name) -> bool {
    !ALONE.contains(&name)
}

/// Whether `name` uses the value network.
pub(in crate::race) fn values(name: Name, race: &RaceSettings) -> bool {
    certifies(name) && settings(name, race).hybrid.value_weight > 0.0
}

/// The controller `name` of `races` races; `world` has the settings of [`settings`].
pub(in crate::race) fn controller<'a>(
    name: Name,
    world: World<'a>,
    races: usize,
    paths: Paths,
) -> Result<Box<dyn Controller + 'a>> {
    let race = world.race;
    let mppi = |key: &str, settings| MppiController::new(world, key, settings, races, paths);
    Ok(match name {
        Name::HybridNoPolicy => Box::new(NoPolicy::new(world, races, paths)?),
        Name::Mppi => Box::new(mppi("race.mppi", &race.mppi)?),
        Name::MppiSoft => Box::new(mppi("race.soft", &race.soft)?),
        Name::MppiCbf => Box::new(mppi("race.cbf", &race.cbf)?.with_filter()?),
        Name::MppiWarmstart if race.warmstart_works => {
            Box::new(mppi("race.warmstart", &race.warmstart)?.warm_started())
        }
        Name::MppiWarmstart => Box::new(mppi("race.warmstart", &race.warmstart)?),
        Name::Policy => Box::new(PolicyController::new(world.policy)),
        Name::PpoCbf => match world.ppo {
            Some(ppo) => Box::new(PolicyController::filtered(world, ppo)?),
            None => {
                let problem = "no policy trained by PPO; name its file in `race.networks.ppo`";
                return Err(Error::invalid("ppo-cbf", problem));
            }
        },
        // The hybrid and what it is without one of its parts differ in their settings alone.
        _ => Box::new(Hybrid::new(world, races, paths)?),
    })
}
