//! Certified sets without samples: states around which a whole ball is enclosed and succeeds.

use super::Context;
use super::deterministic::Deterministic;
use super::enclosed_record::EnclosedRecord;
use super::margins::check_margins;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::model::{Form, Model, Plant};
use crate::rollout::{
    DeviationTask, PairMeasure, Query, RolloutSpec, StateList, States, Tightening,
};
use crate::rounding::as_written;

/// States between two looks at whether to stop.
const CHUNK: usize = 64;
/// Least measure in f32 below which a rollout is taken to fail: rounding of a margin of order 10.
const LEAST_BAND: f64 = 1e-5;

/// Certifies the states around which every start of a ball succeeds, in real arithmetic.
#[derive(Clone, Debug)]
pub struct Enclosure<'a> {
    certificate: Deterministic<'a>,
    radius: f64,
}

impl<'a> Enclosure<'a> {
    /// The enclosure that `settings` ask for, of balls and controls as the deviation bound has them; none
    /// where margins decide.
    ///
    /// # Errors
    /// [`Error::Invalid`] for `pieces` of a plant that is not linear in its state, or in closed loop.
    pub fn of(plant: &'a Plant, settings: &Settings) -> Result<Option<Self>> {
        let Some(kind) = settings.enclosed else { return Ok(None) };
        let asked = &settings.deviation;
        let certificate = Deterministic::new(plant, settings.spec, asked.control, kind);
        let certificate = certificate.map_err(named)?;
        // Never less than the words say: the f32 of a decimal may be below it.
        let radius = f64::from(asked.radius).max(as_written(asked.radius));
        Ok(Some(Self { certificate, radius }))
    }

    /// `V_check` of each of `states`, rounded down to f32 without a change of sign; of those whose own
    /// rollout fails by more than `band`, the measure of that. As a sign, 1 or -1.
    pub(super) fn margins(
        &self,
        context: Context<'_>,
        spec: &RolloutSpec,
        states: States<'_>,
        query: Query,
        band: f64,
    ) -> Result<Vec<f32>> {
        let none = Tightening::none(spec);
        let mut margins = check_margins(context, spec, &none, states, Query::Measure, band)?;
        let places = open(margins.iter().copied(), band);
        for places in places.chunks(CHUNK) {
            let starts = places.iter().map(|place| states.row(*place));
            let found = self.looked_at(&StateList::new(states.size()).with(starts), query);
            for (place, margin) in places.iter().zip(found) {
                margins[*place] = margin;
            }
            context.watch.advance(0)?;
        }
        Ok(margins)
    }

    /// Whether the ball around the nominal start of each of the pairs `first..` of `task` succeeds; none of
    /// those whose own rollout fails by more than `band` does.
    pub(super) fn pairs(
        &self,
        context: Context<'_>,
        task: &DeviationTask<'_>,
        first: u64,
        pairs: &[PairMeasure],
        band: f64,
    ) -> Result<Vec<bool>> {
        let mut certified = vec![false; pairs.len()];
        let places = open(pairs.iter().map(|pair| pair.nominal), band);
        for places in places.chunks(CHUNK) {
            let starts = places.iter().map(|place| task.pairs.nominal.start(first + *place as u64));
            let starts = StateList::new(context.model().states.len()).with(starts);
            let found = self.certificate.certified(starts.view(), self.radius);
            for (place, found) in places.iter().zip(found) {
                certified[*place] = found;
            }
            context.watch.advance(0)?;
        }
        Ok(certified)
    }

    /// `V_check` of `starts`, or its sign.
    fn looked_at(&self, starts: &StateList, query: Query) -> Vec<f32> {
        match query {
            Query::Sign => {
                let certified = self.certificate.certified(starts.view(), self.radius);
                certified.into_iter().map(|certified| if certified { 1.0 } else { -1.0 }).collect()
            }
            Query::Measure => {
                let verdicts = self.certificate.verdicts(starts.view(), self.radius);
                verdicts.into_iter().map(|verdict| rounded_down(verdict.margin)).collect()
            }
        }
    }
}

/// What `settings` ask of the certified set; none where margins decide.
pub(super) fn record(model: &Model, settings: &Settings) -> Option<EnclosedRecord> {
    let asked = &settings.deviation;
    // As it was written: 0.1, not 0.10000000149.
    let radius = as_written(asked.radius);
    let deed = model.task.short_words(Form::One, settings.spec.horizon);
    settings.enclosed.map(|kind| EnclosedRecord::new(kind, asked.control, radius, &deed))
}

/// Places of the measures that are not below zero by more than `band`, or by the rounding of f32.
fn open(measures: impl Iterator<Item = f32>, band: f64) -> Vec<usize> {
    let band = band.max(LEAST_BAND);
    let open = |measure: f32| f64::from(measure) > -band;
    measures.enumerate().filter(|(_, measure)| open(*measure)).map(|(place, _)| place).collect()
}

/// The largest f32 that is not above `margin`, but the least positive one of a positive `margin` below it.
fn rounded_down(margin: f64) -> f32 {
    let near = margin as f32;
    let below = if f64::from(near) > margin { near.next_down() } else { near };
    let least = if margin > 0.0 { f32::from_bits(1) } else { f32::MIN };
    below.clamp(least, f32::MAX)
}

/// A refusal under the key that asks for the certified set.
fn named(error: Error) -> Error {
    match error {
        Error::Invalid { problem, .. } => Error::invalid("global.tightening", problem),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_are_rounded_down_and_keep_their_signs() {
        for (margin, rounded) in [
            (0.5, 0.5),
            (0.1, 0.1_f32.next_down()),
            (-0.1, -0.1_f32),
            (1e-300, f32::from_bits(1)),
            (0.0, 0.0),
            (-1e-300, -f32::from_bits(1)),
            (f64::MAX, f32::MAX),
            (f64::NEG_INFINITY, f32::MIN),
        ] {
            assert_eq!(rounded_down(margin), rounded, "{margin}");
        }
    }

    #[test]
    fn failures_beyond_the_band_are_not_looked_at() {
        let measures = [0.3, -1e-6, -1e-4, f32::NAN, f32::MIN, 0.0];
        assert_eq!(open(measures.into_iter(), 0.0), [0, 1, 5]);
        assert_eq!(open(measures.into_iter(), 1e-3), [0, 1, 2, 5]);
    }
}
