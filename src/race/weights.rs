//! Plans whose weights say little: samples that weigh the same, and costs that f32 cannot tell apart.

use super::controller::Name;
use super::settings::{PlanSettings, RaceSettings};
use crate::scenario::sampling::spacing;

/// Share of the samples from which on they count as weighing the same.
const ALL: f64 = 0.99;
/// Share of the temperature from which on the spacing of costs shows in the weights.
const COARSE: f64 = 0.05;

/// What is known of the plans of a controller, or of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weights {
    /// Samples K of a plan.
    pub(super) samples: u64,
    /// Temperature lambda, in units of cost.
    pub(super) temperature: f64,
    /// Mean effective samples, `1 / sum w^2`.
    pub(super) effective: Option<f64>,
    /// Mean of the smallest cost of a sample.
    pub(super) best_cost: Option<f64>,
}

impl Weights {
    /// Why the weights of `name` say little, with the figures and what to do; none where they do not.
    pub(super) fn note(&self, name: &str) -> Option<String> {
        let Self { samples, temperature, effective, best_cost } = *self;
        let apart = best_cost.map(spacing).filter(|apart| *apart > COARSE * temperature);
        if let (Some(apart), Some(cost)) = (apart, best_cost) {
            return Some(format!(
                "{name}: costs around {cost:.3e} lie {apart} apart in f32, {:.0} % of the temperature \
                 {temperature}: smaller differences of samples are lost; take off what all samples \
                 pay, or scale weights and temperature down",
                100.0 * apart / temperature
            ));
        }
        let effective =
            effective.filter(|effective| samples > 1 && *effective > ALL * samples as f64);
        effective.map(|effective| {
            format!(
                "{name}: {effective:.1} of {samples} samples are effective, so all weigh the same and \
                 the plan is their mean: the temperature {temperature} is large beside the differences \
                 of their costs; lower it"
            )
        })
    }
}

/// Steps of samples that the plans of the controller `name` roll out at each control step, at most.
pub(super) fn sample_steps(name: Name, race: &RaceSettings) -> f64 {
    plans(name, race).map_or(0.0, PlanSettings::work)
}

/// The plans of the controller `name`, those with the most work if it has several kinds.
pub(super) fn plans(name: Name, race: &RaceSettings) -> Option<&PlanSettings> {
    let of = |section: &&str| match *section {
        "race.mppi" => &race.mppi,
        "race.soft" => &race.soft,
        "race.cbf" => &race.cbf,
        "race.warmstart" => &race.warmstart,
        "race.no_policy.recovery" => &race.no_policy.recovery,
        "race.no_policy.fast" => &race.no_policy.fast,
        "race.hybrid.recovery" => &race.hybrid.recovery,
        _ => &race.hybrid.fast,
    };
    name.plan_sections().iter().map(of).max_by(|a, b| a.work().total_cmp(&b.work()))
}

/// The note on the controller `name` with `race` for its settings, whose plans came to these means.
pub(super) fn note(name: Name, race: &RaceSettings, means: [Option<f64>; 2]) -> Option<String> {
    let plan = plans(name, race)?;
    let [effective, best_cost] = means;
    let (samples, temperature) = (u64::from(plan.samples), f64::from(plan.temperature));
    Weights { samples, temperature, effective, best_cost }.note(name.text())
}

#[cfg(test)]
mod tests {
    use super::super::tests::Course;
    use super::*;

    fn said(effective: f64, best_cost: f64) -> Option<String> {
        let (effective, best_cost) = (Some(effective), Some(best_cost));
        Weights { samples: 500, temperature: 10.0, effective, best_cost }.note("mppi")
    }

    #[test]
    fn weights_that_say_little_are_told_with_their_figures() {
        assert_eq!(said(40.0, 1000.0), None);
        let flat = said(499.9, 1000.0).unwrap();
        assert!(flat.contains("499.9 of 500") && flat.contains("lower it"), "{flat}");
        // Twenty stages of a million each.
        let drowned = said(40.0, 2e7).unwrap();
        for words in ["2.000e7", "lie 2 apart", "20 % of the temperature 10"] {
            assert!(drowned.contains(words), "{drowned}");
        }
        let lone = Weights { samples: 1, temperature: 1.0, effective: Some(1.0), best_cost: None };
        assert_eq!(lone.note("mppi"), None);
    }

    #[test]
    fn every_section_of_plans_is_found() {
        let mut race = Course::new().race;
        race.hybrid.fast.samples = 7000;
        race.no_policy.recovery.samples = 6000;
        race.cbf.samples = 5000;
        let samples = |name| plans(name, &race).map(|plan| plan.samples);
        assert_eq!(samples(Name::Hybrid), Some(7000));
        assert_eq!(samples(Name::HybridNoPolicy), Some(6000));
        assert_eq!(samples(Name::MppiCbf), Some(5000));
        assert_eq!(samples(Name::Policy), None);
    }
}
