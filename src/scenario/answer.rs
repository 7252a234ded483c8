//! What a stored certificate says of states beside their tier: score, calibrated measure, certified radius.

use serde::Serialize;

use super::drops_record::{CalibrationRecord, DropsRecord, SequenceRecord};
use super::global::check_margins;
use super::record::{Record, decimal};
use super::settings::Settings;
use super::{Context, deterministic_set};
use crate::error::Result;
use crate::rollout::drops::Shapes;
use crate::rollout::replay::states_margins;
use crate::rollout::{Query, RolloutSpec, States, Tightening};

/// What is said of one state; nothing of a part that the certificate does not have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Beside {
    /// The largest lambda at which it is certified by margin drops: in the certified set where it is above the
    /// level that the sequence chose.
    #[serde(with = "crate::files::number", skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
    /// Its reach-avoid measure, where there is a calibration.
    #[serde(with = "crate::files::number", skip_serializing_if = "Option::is_none")]
    pub measure: Option<f64>,
    /// Whether the measure is above alpha.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<bool>,
    /// Radius of a ball around it that is certified without samples, up to eight times the one asked for; 0
    /// where none was found.
    #[serde(with = "crate::files::number", skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
}

/// What `record` says of each of `states`.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn beside(
    context: Context<'_>,
    record: &Record,
    settings: &Settings,
    states: States<'_>,
) -> Result<Vec<Beside>> {
    let ask = Ask { context, spec: &settings.spec, states, band: record.global.band };
    let mut answers = vec![Beside::default(); states.len()];
    let level = record.sequence.as_ref().and_then(SequenceRecord::level);
    if let (Some(drops), Some(level)) = (&record.drops, level) {
        let scores = ask.scores(drops, level)?;
        answers.iter_mut().zip(scores).for_each(|(one, score)| one.score = Some(score));
    }
    if let Some(CalibrationRecord { level, .. }) = &record.calibration {
        for (one, measure) in answers.iter_mut().zip(ask.measures(*level)?) {
            (one.measure, one.calibrated) = (Some(measure), Some(measure > *level));
        }
    }
    let certified = record.deterministic.as_ref();
    let radii = certified.map(|_| deterministic_set::radii_around(context, settings, states));
    if let Some(radii) = radii.transpose()?.flatten() {
        answers.iter_mut().zip(radii).for_each(|(one, radius)| one.radius = Some(radius));
    }
    Ok(answers)
}

/// States that are asked about.
struct Ask<'a> {
    context: Context<'a>,
    spec: &'a RolloutSpec,
    states: States<'a>,
    band: f64,
}

impl Ask<'_> {
    /// The score of each state.
    fn scores(&self, drops: &DropsRecord, level: f64) -> Result<Vec<f64>> {
        let (shapes, plain) = (drops.shapes(), RolloutSpec { gamma: 1.0, ..*self.spec });
        let in_f64 = |x: &[f32]| shapes.score(&states_margins(self.context.plant(), x, self.spec));
        self.of_each(&plain, &shapes.units(), level, in_f64)
    }

    /// The measure of each state, as calibration has it.
    fn measures(&self, alpha: f64) -> Result<Vec<f64>> {
        let units = Shapes::of_discount(self.spec);
        let (spec, tightening) = match self.context.model().points {
            1 => (*self.spec, Tightening::none(self.spec)),
            // In these units points are discounted as the sample after them.
            _ => (RolloutSpec { gamma: 1.0, ..*self.spec }, units.units()),
        };
        let in_f64 = |x: &[f32]| units.score(&states_margins(self.context.plant(), x, self.spec));
        self.of_each(&spec, &tightening, alpha, in_f64)
    }

    /// The measure of each state, in f64 where f32 cannot tell on which side of `level` or of 0 it lies.
    fn of_each(
        &self,
        spec: &RolloutSpec,
        tightening: &Tightening,
        level: f64,
        in_f64: impl Fn(&[f32]) -> f64,
    ) -> Result<Vec<f64>> {
        let query = Query::Measure;
        let found = check_margins(self.context, spec, tightening, self.states, query, self.band)?;
        let near = |one: f64| (one - level).abs() <= self.band * level.abs().max(1.0);
        let of = |(x, one): (&[f32], f32)| match near(f64::from(one)) {
            true => in_f64(x),
            false => decimal(one),
        };
        Ok(self.states.iter().zip(found).map(of).collect())
    }
}
