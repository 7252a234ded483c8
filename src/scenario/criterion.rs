//! What certifies a start: what is left of its margins, or an enclosure of the ball around it.

use super::Context;
use super::enclosure::Enclosure;
use super::margins::check_margins;
use super::settings::Settings;
use crate::error::Result;
use crate::model::Plant;
use crate::rollout::{DeviationTask, PairMeasure, Query, RolloutSpec, States, Tightening};

/// What certifies a start.
#[derive(Clone, Debug)]
pub enum Criterion<'a> {
    /// The reach-avoid measure with margins that lose something is positive.
    Margins(Tightening),
    /// The measure is positive all over the ball around the start.
    Enclosed(Enclosure<'a>),
}

impl<'a> Criterion<'a> {
    /// The enclosure that `settings` ask for, or else margins that lose `tightening`.
    ///
    /// # Errors
    /// As [`Enclosure::of`].
    pub fn new(plant: &'a Plant, settings: &Settings, tightening: &Tightening) -> Result<Self> {
        let enclosure = Enclosure::of(plant, settings)?;
        Ok(enclosure.map_or_else(|| Self::Margins(tightening.clone()), Self::Enclosed))
    }

    /// What the margins lose in rollouts on a backend: nothing where an enclosure decides.
    pub(super) fn tightening(&self, spec: &RolloutSpec) -> Tightening {
        match self {
            Self::Margins(tightening) => tightening.clone(),
            Self::Enclosed(_) => Tightening::none(spec),
        }
    }

    /// `V_check` (or its sign) of each of `states`: a number that is positive where the state is certified.
    ///
    /// Of margins a measure within `band` of zero is that of f64; an enclosure looks at every state whose own
    /// rollout does not fail by more than `band`.
    ///
    /// # Errors
    /// Those of the backend and of the watch.
    pub fn margins(
        &self,
        context: Context<'_>,
        spec: &RolloutSpec,
        states: States<'_>,
        query: Query,
        band: f64,
    ) -> Result<Vec<f32>> {
        match self {
            Self::Margins(tightening) => {
                check_margins(context, spec, tightening, states, query, band)
            }
            Self::Enclosed(enclosure) => enclosure.margins(context, spec, states, query, band),
        }
    }

    /// Whether the ball around the nominal start of each of the pairs `first..` of `task` is enclosed as
    /// asked; none where margins decide.
    ///
    /// # Errors
    /// Those of the watch.
    pub(super) fn enclosed(
        &self,
        context: Context<'_>,
        task: &DeviationTask<'_>,
        first: u64,
        pairs: &[PairMeasure],
        band: f64,
    ) -> Result<Option<Vec<bool>>> {
        match self {
            Self::Margins(_) => Ok(None),
            Self::Enclosed(enclosure) => {
                enclosure.pairs(context, task, first, pairs, band).map(Some)
            }
        }
    }
}
