//! Which sets hold a start: by its score in f32, and near a level in f64.

use super::settings::Settings;
use crate::model::Plant;
use crate::rollout::drops::Shapes;
use crate::rollout::replay::{measure_of, states_margins};
use crate::rollout::{DeviationTask, PairMeasure, RolloutSpec, Starts, Tightening, replay};

/// Whether a draw was decided in f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InF64 {
    /// In f64.
    Yes,
    /// By its f32 measures.
    No,
}

/// What came of a draw.
pub(super) struct Outcome {
    /// The strictest set that holds it, by number.
    pub(super) strictest: usize,
    /// Measure of the perturbed rollout.
    pub(super) perturbed: f64,
    /// How it was decided.
    pub(super) in_f64: InF64,
}

/// Says which sets hold a start: by its score in f32, and near a level by the very tightening that a
/// query of the set takes, in f64.
pub(super) struct Judge<'a> {
    plant: &'a Plant,
    spec: RolloutSpec,
    levels: &'a [f64],
    tightenings: Vec<Tightening>,
    band: f64,
}

impl<'a> Judge<'a> {
    /// The judge of the sets with these levels, strict to lax; scores within `band` of one are near it.
    pub(super) fn new(
        plant: &'a Plant,
        settings: &Settings,
        shapes: &Shapes,
        levels: &'a [f64],
        band: f64,
    ) -> Self {
        let tightenings = levels.iter().map(|level| shapes.tightening(*level)).collect();
        Self { plant, spec: settings.spec, levels, tightenings, band }
    }

    /// A pair by its f32 measures; in f64 where they do not decide it, and where it is a failure that
    /// counts.
    pub(super) fn pair(&self, task: &DeviationTask<'_>, index: u64, pair: PairMeasure) -> Outcome {
        let (score, perturbed) = (f64::from(pair.nominal), f64::from(pair.perturbed));
        let strictest = self.strictest(score);
        let counts = strictest < self.levels.len() && perturbed <= self.band;
        if !(counts || perturbed.abs() <= self.band || self.is_near(score)) {
            return Outcome { strictest, perturbed, in_f64: InF64::No };
        }
        let [nominal, other] = task.pairs.pair(index);
        let margins =
            replay::pair_margins(self.plant, [&nominal, &other], &self.spec, task.control);
        let plain = Tightening::none(&self.spec);
        Outcome {
            strictest: self.strictest_in_f64(&margins.nominal),
            perturbed: measure_of(&margins.perturbed, &self.spec, &plain),
            in_f64: InF64::Yes,
        }
    }

    /// The first level below `score`; their number where there is none.
    fn strictest(&self, score: f64) -> usize {
        self.levels.partition_point(|level| *level >= score)
    }

    /// Whether f32 cannot tell on which side of some level `score` lies.
    fn is_near(&self, score: f64) -> bool {
        let first = self.strictest(score);
        let near = |at: usize| {
            let level = self.levels.get(at);
            level.is_some_and(|level| (level - score).abs() <= self.band * level.abs().max(1.0))
        };
        near(first) || first.checked_sub(1).is_some_and(near)
    }

    /// The first set that holds a nominal rollout with these margins.
    fn strictest_in_f64(&self, nominal: &[replay::Margins]) -> usize {
        self.tightenings.partition_point(|lost| measure_of(nominal, &self.spec, lost) <= 0.0)
    }
}

impl Judge<'_> {
    /// Whether its laxest set holds start `index`, whose score in f32 is `score`.
    pub(super) fn holds(&self, starts: &Starts<'_>, index: u64, score: f64) -> bool {
        if !self.is_near(score) {
            return self.strictest(score) < self.levels.len();
        }
        let margins = states_margins(self.plant, &starts.start(index), &self.spec);
        self.strictest_in_f64(&margins) < self.levels.len()
    }
}
