//! The certified set by margin drops: its level by the sequence, and the shares of all sets.

use super::drops::pairs;
use super::drops_record::{
    CalibrationRecord, DropsRecord, SeenRecord, SequenceOutcome, SequenceRecord, ShareRecord,
};
use super::drops_settings::DropSettings;
use super::membership::{InF64, Judge, Outcome};
use super::probe::{Probe, probe};
use super::record::{GlobalRecord, Record};
use super::sequence::{Counts, Failed, Levels, derived, test};
use super::settings::Settings;
use super::tightened::Tightened;
use super::{Context, calibration, drops, global, purpose, tightened};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::drops::Shapes;
use crate::rollout::{
    DeviationTask, Keep, NON_FINITE, PairMeasure, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, Tightening,
};

/// Starts of the pilot that fixes the levels.
const PILOT: u64 = 4096;

/// What came of the certified set by margin drops.
pub(super) struct Sets {
    /// The certified set.
    pub(super) global: GlobalRecord,
    /// The sequence that chose its level.
    pub(super) sequence: SequenceRecord,
    /// The calibration, where it is asked for.
    pub(super) calibration: Option<CalibrationRecord>,
}

/// Chooses the level of the certified set, and draws the shares: `tightened` has the tightening of the
/// chosen level and the share of the bound's own set afterwards.
///
/// # Errors
/// Those of the backend.
pub(super) fn sets(
    context: Context<'_>,
    settings: &Settings,
    asked: &DropSettings,
    tightened: &mut Tightened,
    bound: &mut DropsRecord,
) -> Result<Sets> {
    let shapes = bound.shapes();
    let Chosen { sequence, tally } = choose(context, settings, asked, &shapes, bound.level)?;
    let level = sequence.level().unwrap_or(f64::INFINITY);
    tightened.tightening = shapes.tightening(level);
    let calibration = asked.calibration.as_ref();
    let calibration =
        calibration.map(|asked| calibration::calibrate(context, settings, asked)).transpose()?;
    let draws = asked.share_draws;
    bound.by_constants = by_constants(context, settings, tightened, draws)?;
    let starts = Fresh { purpose: purpose::FRESH_SHARE, draws, band: tally.band };
    let inside_both = inside(context, settings, &shapes, [bound.level, level], starts)?;
    bound.share = ShareRecord::new(inside_both[0], draws, asked.sample.beta);
    let share = ShareRecord::new(inside_both[1], draws, settings.global.beta);
    let calibration = calibration
        .map(|record| {
            let (levels, units) = ([record.level], Shapes::of_discount(&settings.spec));
            let [inside] = inside(context, settings, &units, levels, starts)?;
            let share = ShareRecord::new(inside, draws, record.claim.beta);
            Ok::<_, Error>(CalibrationRecord { share, ..record })
        })
        .transpose()?;
    let probe = global::probed(context, settings, &tightened.tightening)?;
    let chosen = global::ChosenSet {
        sequence: &sequence,
        share,
        reached: tally.reached,
        non_finite: tally.non_finite,
        probe,
        f64_reruns: tally.f64_reruns,
    };
    let global = global::of_sequence(context.model(), settings, &chosen)?;
    Ok(Sets { global, sequence, calibration })
}

/// The tightening of the level that the sequence chooses, and the sequence.
///
/// # Errors
/// Those of the backend.
pub(crate) fn chosen(
    context: Context<'_>,
    settings: &Settings,
    asked: &DropSettings,
    bound: &DropsRecord,
) -> Result<(Tightening, SequenceRecord)> {
    let shapes = bound.shapes();
    let Chosen { sequence, .. } = choose(context, settings, asked, &shapes, bound.level)?;
    Ok((shapes.tightening(sequence.level().unwrap_or(f64::INFINITY)), sequence))
}

/// What the stored record tightens its margins with.
pub(super) fn tightening(record: &Record, spec: &RolloutSpec) -> Tightening {
    let level = record.sequence.as_ref().and_then(SequenceRecord::level);
    match (&record.drops, level) {
        (Some(drops), Some(level)) => drops.shapes().tightening(level),
        _ => tightened::tightening(&record.deviation.bound, &record.constants, spec),
    }
}

/// What `record` says of these sets as its own numbers and `settings` give it.
///
/// # Errors
/// Settings whose claims could not be made.
pub(super) fn rederived(
    model: &Model,
    settings: &Settings,
    asked: &DropSettings,
    record: &mut Record,
) -> Result<()> {
    let beta = settings.global.beta;
    if let Some(stored) = &record.drops {
        record.drops = Some(drops::derived(model, settings, asked, stored)?);
    }
    if let Some(stored) = &record.sequence {
        record.sequence = Some(derived(stored, asked.risk, beta)?);
    }
    if let (Some(stored), Some(sample)) = (&record.calibration, &asked.calibration) {
        let draws = asked.share_draws;
        let derived = calibration::derived(model, settings, sample, stored, draws)?;
        record.calibration = Some(derived);
    }
    if let (Some(sequence), Some(share)) = (&record.sequence, &record.global.share) {
        let GlobalRecord { reached, non_finite, f32_error, f64_reruns, f32_apart, .. } =
            record.global;
        let probe = Probe { error: f32_error, apart: f32_apart.unwrap_or_default() };
        let share = ShareRecord::new(share.inside, asked.share_draws, beta);
        let chosen = global::ChosenSet { sequence, share, reached, non_finite, probe, f64_reruns };
        record.global = global::of_sequence(model, settings, &chosen)?;
    }
    Ok(())
}

/// The sentences of these sets.
pub(super) fn statements(record: &Record, draws: u64) -> Vec<String> {
    let claims = [
        record.drops.as_ref().map(|drops| &drops.claim),
        record.calibration.as_ref().map(|calibration| &calibration.claim),
    ];
    let mut statements: Vec<String> =
        claims.iter().flatten().map(|claim| claim.statement.clone()).collect();
    if let Some(sequence) = &record.sequence {
        statements.extend(untested(sequence, draws));
    }
    statements
}

/// Rollouts that these sets took, beside the draws.
pub(super) fn rollouts(record: &Record) -> u64 {
    let drops = record.drops.as_ref();
    let bound = drops.map_or(0, |drops| 2 * (drops.pilot + drops.claim.scenarios));
    let calibration = record.calibration.as_ref();
    let calibration = calibration.map_or(0, |calibration| 2 * calibration.claim.scenarios);
    let sets = if record.calibration.is_some() { 2 } else { 1 };
    let share = record.global.share.map_or(0, |share| sets * share.draws);
    bound + calibration + share + record.sequence.as_ref().map_or(0, |sequence| sequence.pilot)
}

/// Why the risk asked for is not the one claimed.
fn untested(sequence: &SequenceRecord, draws: u64) -> Option<String> {
    let (risk, start) = (sequence.risk?, sequence.start?);
    match sequence.outcome {
        SequenceOutcome::Accepted => None,
        SequenceOutcome::Refused => Some(format!(
            "The conditional risk {risk} was not obtained: the strictest set of the sequence was \
             refused, and is reported with the risk obtained."
        )),
        SequenceOutcome::Single => Some(format!(
            "The conditional risk {risk} was not tested: it takes about {start} draws in the set to \
             begin with, {} if none fails, and {draws} draws from the box put too few of them there; \
             raise `global.draws`. One set is reported, with the risk obtained.",
            sequence.required.unwrap_or(start)
        )),
    }
}

/// A level chosen, and how the draws fared.
struct Chosen {
    sequence: SequenceRecord,
    tally: Tally,
}

/// Fixes the levels by a pilot, draws the conditional sample and tests them.
fn choose(
    context: Context<'_>,
    settings: &Settings,
    asked: &DropSettings,
    shapes: &Shapes,
    single: f64,
) -> Result<Chosen> {
    let (draws, beta) = (settings.global.draws, settings.global.beta);
    let scores = pilot_scores(context, settings, shapes)?;
    let levels = Levels::new(scores, draws, asked.risk, beta, single);
    let tally = Tally::draw(context, settings, shapes, &levels)?;
    let sequence = test(&levels, &tally.counts, asked.risk, beta, PILOT)?;
    Ok(Chosen { sequence, tally })
}

/// A measure without discount, as a score has it.
fn undiscounted(settings: &Settings) -> RolloutSpec {
    RolloutSpec { gamma: 1.0, ..settings.spec }
}

/// Scores of starts of the pilot, in f32: they only fix levels.
fn pilot_scores(context: Context<'_>, settings: &Settings, shapes: &Shapes) -> Result<Vec<f64>> {
    context.watch.begin("pilot of the levels", PILOT);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    // The first stream of the purpose is that of the pairs.
    let stream = settings.stream(purpose::DROPS_PILOT_NOMINAL, 1);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream },
        range: 0..PILOT,
        spec: undiscounted(settings),
        tightening: &shapes.units(),
        query: Query::Measure,
    };
    let mut scores = Vec::new();
    context.program.reach_avoid(&task, &mut |_, values| {
        scores.extend(values.iter().map(|value| f64::from(*value)));
        context.watch.advance(values.len() as u64)
    })?;
    Ok(scores)
}

/// How the draws of the conditional sample fared.
struct Tally {
    counts: Counts,
    /// Perturbed starts that reach the target.
    reached: u64,
    /// Perturbed rollouts that failed for a state that is not finite.
    non_finite: u64,
    /// Draws that were decided in f64.
    f64_reruns: u64,
    /// Scores this close to a level, and measures this close to zero, are decided in f64.
    band: f64,
}

impl Tally {
    /// Draws the pairs and finds for each the strictest set that holds it.
    fn draw(
        context: Context<'_>,
        settings: &Settings,
        shapes: &Shapes,
        levels: &Levels,
    ) -> Result<Self> {
        let draws = settings.global.draws;
        let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
        let task = DeviationTask {
            pairs: pairs(settings, purposes)?,
            range: 0..draws,
            spec: undiscounted(settings),
            tightening: &shapes.units(),
            control: settings.deviation.control,
        };
        context.watch.begin("certified set", draws);
        let band = global::band_of(probe(context, &task)?.error);
        let judge = Judge::new(context.plant(), settings, shapes, &levels.levels, band);
        let counts = Counts::new(levels.levels.len());
        let mut tally = Self { counts, reached: 0, non_finite: 0, f64_reruns: 0, band };
        context.program.deviation(&task, &mut |first, measured| {
            for (index, pair) in (first..).zip(measured) {
                tally.add(&judge, &task, index, *pair);
            }
            context.watch.advance(measured.len() as u64)
        })?;
        Ok(tally)
    }

    /// Adds pair `index`.
    fn add(&mut self, judge: &Judge<'_>, task: &DeviationTask<'_>, index: u64, pair: PairMeasure) {
        let Outcome { strictest, perturbed, in_f64 } = judge.pair(task, index, pair);
        self.f64_reruns += u64::from(in_f64 == InF64::Yes);
        self.reached += u64::from(perturbed > 0.0);
        self.non_finite += u64::from(perturbed == f64::from(NON_FINITE));
        self.counts.add(strictest, if perturbed > 0.0 { Failed::No } else { Failed::Yes });
    }
}

/// Fresh starts that estimate shares.
#[derive(Clone, Copy)]
pub(super) struct Fresh {
    /// What they are drawn for.
    pub(super) purpose: Purpose,
    /// How many.
    pub(super) draws: u64,
    /// Scores this close to a level are decided in f64.
    pub(super) band: f64,
}

/// How many fresh starts lie in the set of each of `levels`.
pub(super) fn inside<const SETS: usize>(
    context: Context<'_>,
    settings: &Settings,
    shapes: &Shapes,
    levels: [f64; SETS],
    starts: Fresh,
) -> Result<[u64; SETS]> {
    let Fresh { purpose, draws, band } = starts;
    context.watch.begin("share of the sets", draws);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let stream = settings.stream(purpose, 0);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream },
        range: 0..draws,
        spec: undiscounted(settings),
        tightening: &shapes.units(),
        query: Query::Measure,
    };
    let judges = levels.each_ref().map(|level| {
        Judge::new(context.plant(), settings, shapes, std::slice::from_ref(level), band)
    });
    let mut inside = [0; SETS];
    context.program.reach_avoid(&task, &mut |first, values| {
        for (index, value) in (first..).zip(values) {
            for (inside, judge) in inside.iter_mut().zip(&judges) {
                *inside += u64::from(judge.holds(&task.starts, index, f64::from(*value)));
            }
        }
        context.watch.advance(values.len() as u64)
    })?;
    Ok(inside)
}

/// How many of the first fresh starts constants times the deviation bound would certify: as many starts
/// as the conditional sample has draws, and no more than `draws`.
fn by_constants(
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
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let stream = settings.stream(purpose::FRESH_SHARE, 0);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream },
        range: 0..draws.min(settings.global.draws),
        spec: settings.spec,
        tightening: &lost,
        query: Query::Sign,
    };
    let tally = context.program.tally(&task, Keep::Counts)?;
    Ok(Some(SeenRecord { draws: task.range.end, inside: tally.counts().successes }))
}
