//! Shares of the box that sets by a score have, from fresh starts.

use std::ops::Range;

use super::drops_record::SeenRecord;
use super::membership::Judge;
use super::settings::Settings;
use super::tightened::Tightened;
use super::{Context, global, purpose, tightened};
use crate::error::Result;
use crate::rollout::drops::Shapes;
use crate::rollout::{
    Keep, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, StateList, Tightening,
};

/// Starts that are looked at together.
const CHUNK: u64 = 1 << 17;

/// Sets of one score.
pub(super) struct Scored<'a> {
    /// The units of the score.
    pub(super) shapes: &'a Shapes,
    /// A set is the starts with a score above its level, at least 0.
    pub(super) levels: Vec<f64>,
}

/// What the fresh starts came to.
pub(super) struct Inside {
    /// For each score and level, starts in the set.
    pub(super) counts: Vec<Vec<u64>>,
    /// Rollouts that it took.
    pub(super) rollouts: u64,
}

/// A measure without discount, as a score has it.
pub(super) fn undiscounted(settings: &Settings) -> RolloutSpec {
    RolloutSpec { gamma: 1.0, ..settings.spec }
}

/// Fresh starts of the box that estimate shares.
#[derive(Clone, Copy)]
pub(super) struct Fresh {
    /// What they are drawn for.
    pub(super) purpose: Purpose,
    /// How many.
    pub(super) draws: u64,
    /// Scores this close to a level are decided in f64.
    pub(super) band: f64,
}

impl Fresh {
    fn starts(&self, settings: &Settings) -> Result<Starts<'static>> {
        let region = Region::new_box(&*settings.low, &*settings.high)?;
        Ok(Starts::Drawn { region, stream: settings.stream(self.purpose, 0) })
    }
}

/// How many of the fresh starts lie in each set, by score and level.
///
/// No set holds a start whose own rollout fails, since levels are at least 0: signs, of which most are
/// decided early, leave the starts whose scores are asked for.
pub(super) fn inside(
    context: Context<'_>,
    settings: &Settings,
    scored: &[Scored<'_>],
    fresh: Fresh,
) -> Result<Inside> {
    let Fresh { draws, band, .. } = fresh;
    let starts = fresh.starts(settings)?;
    context.watch.begin("share of the sets", draws);
    let plain = Tightening::none(&settings.spec);
    let slack = global::band(context, settings, &plain)? as f32;
    let counts = scored.iter().map(|one| vec![0; one.levels.len()]).collect();
    let mut inside = Inside { counts, rollouts: draws };
    for from in (0..draws).step_by(CHUNK as usize) {
        let range = from..draws.min(from + CHUNK);
        let candidates = candidates(context, settings, &starts, range, slack)?;
        for (one, counts) in scored.iter().zip(&mut inside.counts) {
            if !candidates.is_empty() && !counts.is_empty() {
                count(context, settings, one, &candidates, band, counts)?;
                inside.rollouts += candidates.len() as u64;
            }
        }
    }
    Ok(inside)
}

/// The fresh starts of `range` whose own rollout succeeds, by no less than `-slack`: what f32 may take off.
fn candidates(
    context: Context<'_>,
    settings: &Settings,
    starts: &Starts<'_>,
    range: Range<u64>,
    slack: f32,
) -> Result<StateList> {
    let gained = vec![-slack; settings.spec.horizon as usize + 1];
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range,
        spec: settings.spec,
        tightening: &Tightening::losing(gained.clone(), gained),
        query: Query::Sign,
    };
    let mut found = StateList::new(settings.low.len());
    context.program.reach_avoid(&task, &mut |first, signs| {
        let succeed = (first..).zip(signs).filter(|(_, sign)| **sign > 0.0);
        succeed.for_each(|(index, _)| found.push(&starts.start(index)));
        context.watch.advance(signs.len() as u64)
    })?;
    Ok(found)
}

/// Adds to `inside` how many of `candidates` each set of one score holds.
fn count(
    context: Context<'_>,
    settings: &Settings,
    scored: &Scored<'_>,
    candidates: &StateList,
    band: f64,
    inside: &mut [u64],
) -> Result<()> {
    let judges: Vec<Judge<'_>> = scored
        .levels
        .iter()
        .map(|level| {
            let levels = std::slice::from_ref(level);
            Judge::new(context.plant(), settings, scored.shapes, levels, band)
        })
        .collect();
    let task = ReachAvoidTask {
        starts: Starts::Listed(candidates.view()),
        range: 0..candidates.len() as u64,
        spec: undiscounted(settings),
        tightening: &scored.shapes.units(),
        query: Query::Measure,
    };
    context.program.reach_avoid(&task, &mut |first, values| {
        for (index, value) in (first..).zip(values) {
            for (inside, judge) in inside.iter_mut().zip(&judges) {
                *inside += u64::from(judge.holds(&task.starts, index, f64::from(*value)));
            }
        }
        Ok(())
    })
}

/// How many of the first fresh starts constants times the deviation bound would certify: as many starts
/// as the conditional sample has draws, and no more than `draws`.
pub(super) fn by_constants(
    context: Context<'_>,
    settings: &Settings,
    tightened: &Tightened,
    draws: u64,
) -> Result<Option<SeenRecord>> {
    let Tightened { constants, deviation, .. } = tightened;
    if ![&constants.target, &constants.constraint].iter().all(|one| one.used.is_finite()) {
        return Ok(None);
    }
    let lost = tightened::tightening(&deviation.bound, constants, &settings.spec);
    let draws = draws.min(settings.global.draws);
    let fresh = Fresh { purpose: purpose::FRESH_SHARE, draws, band: 0.0 };
    let task = ReachAvoidTask {
        starts: fresh.starts(settings)?,
        range: 0..draws,
        spec: settings.spec,
        tightening: &lost,
        query: Query::Sign,
    };
    let tally = context.program.tally(&task, Keep::Counts)?;
    Ok(Some(SeenRecord { draws: task.range.end, inside: tally.counts().successes }))
}
