//! From a name to a controller.

use super::baseline::{MppiController, PolicyController};
use super::controller::{Controller, Name, World};
use super::hybrid::Hybrid;
use super::no_policy::NoPolicy;
use super::plan::Paths;
use super::settings::RaceSettings;
use crate::cost::{Fence, RaceCost, Safety};
use crate::error::{Error, Result};

/// The settings of the race as the controller `name` has them.
pub(super) fn settings(name: Name, race: &RaceSettings) -> RaceSettings {
    let mut race = race.clone();
    match name {
        Name::HybridNoGlobal => race.hybrid.global = false,
        Name::HybridNoLocal => race.hybrid.local = false,
        Name::HybridNoRecovery => race.hybrid.recovery_tier = false,
        Name::HybridNoSafety => {
            for plan in [&mut race.hybrid.recovery, &mut race.hybrid.fast] {
                let (safety, fence) = terms(&mut plan.cost);
                (*safety, *fence) = (Safety::NONE, Fence::NONE);
            }
        }
        _ => {}
    }
    race
}

/// Safety and fence terms of a cost.
fn terms(cost: &mut RaceCost) -> (&mut Safety, &mut Fence) {
    match cost {
        RaceCost::Recovery(cost) => (&mut cost.safety, &mut cost.fence),
        RaceCost::Centerline(cost) => (&mut cost.safety, &mut cost.fence),
        RaceCost::Lane(cost) => (&mut cost.safety, &mut cost.fence),
    }
}

/// Why `name` cannot run with what there is; none if it can.
pub(super) fn absent(name: Name, world: &World<'_>) -> Option<String> {
    let reason = "it needs a policy trained by PPO, and `race.networks.ppo` names no file";
    (name == Name::PpoCbf && world.ppo.is_none()).then(|| reason.to_owned())
}

/// The controller `name` of `races` races; `world` has the settings of [`settings`].
pub(super) fn controller<'a>(
    name: Name,
    world: World<'a>,
    races: usize,
    paths: Paths,
) -> Result<Box<dyn Controller + 'a>> {
    let race = world.race;
    let mppi = |key: &str, settings| MppiController::new(world, (key, settings), races, paths);
    Ok(match name {
        Name::Hybrid
        | Name::HybridNoGlobal
        | Name::HybridNoLocal
        | Name::HybridNoRecovery
        | Name::HybridNoSafety => Box::new(Hybrid::new(world, races, paths)?),
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
    })
}
