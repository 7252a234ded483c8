//! The certified set by margin drops: its level by the sequence, and the shares of all sets.

use super::drops::pairs;
use super::drops_record::{
    CalibrationRecord, DropsRecord, SequenceOutcome, SequenceRecord, ShareRecord,
};
use super::drops_settings::DropSettings;
use super::membership::{InF64, Judge, Outcome};
use super::probe::{Probe, probe};
use super::record::{GlobalRecord, Record};
use super::sequence::{Counts, Failed, Levels, derived, test};
use super::settings::Settings;
use super::shares::{self, Fresh, Scored, undiscounted};
use super::tightened::Tightened;
use super::{Context, calibration, drops, global, purpose, tightened};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::drops::Shapes;
use crate::rollout::{
    DeviationTask, NON_FINITE, PairMeasure, Query, ReachAvoidTask, Region, RolloutSpec, Starts,
    Tightening,
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
    /// Rollouts that the shares took.
    pub(super) share_rollouts: u64,
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
    bound.by_constants = shares::by_constants(context, settings, tightened, draws)?;
    let units = Shapes::of_discount(&settings.spec);
    let by_drops = Scored { shapes: &shapes, levels: vec![bound.level, level] };
    let by_measure =
        Scored { shapes: &units, levels: calibration.iter().map(|record| record.level).collect() };
    let scored = [by_drops, by_measure];
    let fresh = Fresh { purpose: purpose::FRESH_SHARE, draws, band: tally.band };
    let inside = shares::inside(context, settings, &scored, fresh)?;
    bound.share = ShareRecord::new(inside.counts[0][0], draws, asked.sample.beta);
    let share = ShareRecord::new(inside.counts[0][1], draws, settings.global.beta);
    let calibration = calibration.map(|record| {
        let share = ShareRecord::new(inside.counts[1][0], draws, record.claim.beta);
        CalibrationRecord { share, ..record }
    });
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
    Ok(Sets { global, sequence, calibration, share_rollouts: inside.rollouts })
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
    refuse_unsound(record)?;
    if let Some(stored) = &record.drops {
        record.drops = Some(drops::derived(model, settings, asked, stored)?);
    }
    if let Some(stored) = &record.sequence {
        record.sequence = Some(derived(stored, asked.risk_value(), beta)?);
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

/// Refuses levels and units that no draw of any pairs comes to.
fn refuse_unsound(record: &Record) -> Result<()> {
    let refused = |field: &str, problem: &str| {
        Err(Error::Refused(format!("{field} {problem}; certify again")))
    };
    let is_level = |level: f64| level >= 0.0;
    let (Some(drops), Some(sequence)) = (&record.drops, &record.sequence) else {
        return refused("drops", "and sequence are not both there");
    };
    let mut units = drops.target_shape.iter().chain(&drops.constraint_shape);
    if !units.all(|unit| *unit > 0.0 && unit.is_finite()) {
        return refused("drops.target_shape", "or constraint_shape is not positive throughout");
    }
    let levels: Vec<f64> = sequence.levels.iter().map(|level| level.level).collect();
    if !levels.iter().all(|level| is_level(*level)) || !levels.is_sorted_by(|a, b| a > b) {
        return refused("sequence.levels", "do not descend to 0");
    }
    if !is_level(drops.level) || drops.level > 1.000_001 * drops.largest.max(0.0) {
        return refused("drops.level", "is not a level of these pairs");
    }
    match &record.calibration {
        Some(calibration) if !is_level(calibration.level) => {
            refused("calibration.level", "is below 0")
        }
        _ => Ok(()),
    }
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

/// Rollouts that these sets took, beside the draws and the shares.
pub(super) fn rollouts(record: &Record) -> u64 {
    let drops = record.drops.as_ref();
    let bound = drops.map_or(0, |drops| 2 * (drops.pilot + drops.claim.scenarios));
    let calibration = record.calibration.as_ref();
    let calibration = calibration.map_or(0, |calibration| 2 * calibration.claim.scenarios);
    bound + calibration + record.sequence.as_ref().map_or(0, |sequence| sequence.pilot)
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
    let levels = Levels::new(scores, draws, asked.risk_value(), beta, single);
    let tally = Tally::draw(context, settings, shapes, &levels)?;
    let sequence = test(&levels, &tally.counts, asked.risk_value(), beta, PILOT)?;
    Ok(Chosen { sequence, tally })
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
