//! One race flown again by itself, with everything that a picture shows.

use super::controller::plan::Paths;
use super::controller::roster::controller;
use super::controller::{Decision, Name, World};
use super::flight::fly;
use super::judge::{Judge, verdict};
use super::record::{FrameBall, FrameRecord, PictureRecord};
use crate::error::Result;
use crate::scenario::Watch;

/// The race number `number` from `start`, with `noise_seed` and, of that, its own `seed`.
pub(super) fn picture(
    name: Name,
    world: World<'_>,
    number: usize,
    start: [f32; 12],
    noise_seed: u64,
    seed: u64,
    watch: &dyn Watch,
) -> Result<PictureRecord> {
    let steps = world.race.steps;
    let mut controller = controller(name, world, 1, Paths::Drawn)?;
    watch.begin("picture", u64::from(steps));
    let flights = fly(controller.as_mut(), world.system, &[start], &[seed], steps, watch)?;
    let flight = &flights[0];
    let verdicts = Judge::ALL.map(|judge| (judge, verdict(judge, &flight.states)));
    let decided = flight.decisions.iter().map(Some).chain(std::iter::once(None));
    let frames = flight.states.iter().zip(decided).enumerate();
    let axis = |i: usize| {
        let axes = world.certificates.slice.as_ref();
        axes.map_or_else(Vec::new, |axes| axes[i].values.clone())
    };
    Ok(PictureRecord {
        controller: name.text().to_owned(),
        start: number as u64,
        noise_seed,
        verdicts: verdicts.to_vec(),
        slice_x: axis(0),
        slice_y: axis(1),
        frames: frames.map(|(step, (x, decision))| frame(step as u32, x, decision)).collect(),
    })
}

/// The state of one step and what was decided there.
fn frame(step: u32, x: &[f32; 12], decision: Option<&Decision>) -> FrameRecord {
    let ball = decision.and_then(|decision| decision.growth.as_ref()).map(|growth| FrameBall {
        center: [growth.ball.center[0], growth.ball.center[2]],
        radius: growth.ball.radius,
        verified: growth.verified,
        rounds: growth.rounds,
    });
    let cells = decision.map(|decision| decision.certified.clone());
    FrameRecord {
        step,
        x: x.to_vec(),
        u: decision.map(|decision| decision.control.to_vec()),
        tier: decision.and_then(|decision| decision.tier).map(|tier| tier.number()),
        check_margin: decision.and_then(|decision| decision.check_margin),
        certified: cells.filter(|cells| !cells.is_empty()),
        ball,
        recovery: decision.and_then(|decision| decision.recovery).map(|[x, y, _]| [x, y]),
        fan: decision.map_or_else(Vec::new, |decision| decision.fan.clone()),
    }
}
