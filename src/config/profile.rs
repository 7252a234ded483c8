//! Defaults: the numbers of each profile that plants share, and those of the double integrator.

use super::deterministic::DeterministicSection;
use super::drops::{self, CalibrationSection, DropsSection, TighteningSource};
use super::learning;
use super::named_system::NamedSystem;
use super::registry::Registry;
use super::section::{
    Config, ConstantsSection, DeviationSection, GlobalSection, GrowthSection, PolicySection,
    Profile, RolloutSection, SliceAxisSection, SliceSection,
};
use super::sequential::SequentialSection;
use super::sources::Sources;
use super::train;
use super::value::{Constant, Coordinates, Named};
use crate::plan::PlanSettings;
use crate::rollout::PairControl;
use crate::scenario::growth_plan::{Around, GrowthMethod, GrowthPlan, GrowthShape};
use crate::scenario::least_perturbation;
use crate::scenario::record::decimal;
use crate::scenario::settings::{BoundarySearch, ConstantRegion, DeviationSource, Joint};
use crate::studies::SystemSection;
use crate::system::{Axis, DoubleIntegrator, System};

/// Steps of a slice that nobody asked for.
const SLICE_STEPS: f64 = 20.0;
/// Share of the least radius that f32 has points enough for, so that it is one in f32 too.
const ENOUGH: f64 = 1.001;

/// The double integrator; the published study has no such experiment, so the profiles differ in
/// their accounting alone.
pub(crate) fn double_integrator(profile: Profile) -> Config {
    let plain = DoubleIntegrator::default();
    let system = SystemSection::DoubleIntegrator {
        target: decimal(plain.target),
        corridor: decimal(plain.corridor),
        acceleration: decimal(plain.acceleration),
    };
    let slice =
        SliceSection { x: axis("position", -1.2, 1.2, 0.05), y: axis("velocity", -1.5, 1.5, 0.05) };
    let mut config = common(profile, Some(system), &plain.states(), &[0.6, 0.0], slice);
    config.deviation.radius = 0.02;
    config.growth.radius = 0.2;
    config.train = Some(train::double_integrator());
    config
}

/// A plant of the user's own with these states. Its state is the middle of the box, its slice that of
/// the first two states over their box in twenty cells; perturbations have a fiftieth of the
/// narrowest side of the box as their radius, growth begins with a quarter of it.
pub(super) fn described(profile: Profile, states: &[Axis]) -> Config {
    let middle = |axis: &Axis| 0.5 * (decimal(axis.low) + decimal(axis.high));
    let state: Vec<f64> = states.iter().map(middle).collect();
    let side = |axis: &Axis| {
        let (from, to) = (decimal(axis.low), decimal(axis.high));
        // A frozen state has no side to cut; its slice shows what lies around.
        if from < to { (from, to) } else { (from - 0.5, from + 0.5) }
    };
    let cut = |axis: &Axis| {
        let (from, to) = side(axis);
        let step = (to - from) / SLICE_STEPS;
        // The middles of the cells, so that these cover the box.
        SliceAxisSection { state: axis.name.clone(), from: from + 0.5 * step, to, step }
    };
    let [x, y] = [0, states.len().min(2) - 1].map(|i| cut(&states[i]));
    let widths = states.iter().map(|axis| decimal(axis.high) - decimal(axis.low));
    let narrowest = widths.filter(|width| *width > 0.0).fold(f64::INFINITY, f64::min);
    let narrowest = if narrowest.is_finite() { narrowest } else { 1.0 };
    let mut config = common(profile, None, states, &state, SliceSection { x, y });
    let (least, growth) = (ENOUGH * least_perturbation(states), &mut config.growth);
    config.deviation.radius = (narrowest / 50.0).max(least);
    // Upward, the first radius is the one that has to be large enough; those that are too large are not reached.
    let smaller = match growth.method {
        GrowthMethod::Upward => growth.factor.powi(growth.rounds as i32 - 1),
        GrowthMethod::Shrinking => 1.0,
    };
    growth.radius = (narrowest / 4.0).max(least * smaller);
    config.train = Some(learning::described());
    config
}

/// What all systems share.
pub(crate) fn common(
    profile: Profile,
    system: Option<SystemSection>,
    states: &[Axis],
    state: &[f64],
    slice: SliceSection,
) -> Config {
    let rigorous = profile == Profile::Rigorous;
    let (epsilon, beta) = (0.1, 1e-3);
    // The study reports 158; the simple bound asks for 158.16, and a sample is whole.
    let scenarios = if profile == Profile::Study { 158 } else { 159 };
    Config {
        profile,
        seed: 1,
        attempt: None,
        system: system.map(NamedSystem::Carried),
        model: None,
        networks: Vec::new(),
        policy: PolicySection::default(),
        rollout: RolloutSection { horizon: 30, gamma: 0.95 },
        bounds: by_name(states, |axis, _| [decimal(axis.low), decimal(axis.high)]),
        constants: ConstantsSection {
            target: Constant::Computed,
            constraint: Constant::Computed,
            region: ConstantRegion::Visited,
            assume: Vec::new(),
        },
        deviation: DeviationSection {
            radius: 0.1,
            epsilon,
            beta,
            scenarios,
            pilot: 1000,
            joint: if rigorous { Joint::FixedShape } else { Joint::Separate },
            control: PairControl::Replay,
            source: DeviationSource::Scenario,
        },
        global: GlobalSection {
            draws: 20_000,
            beta,
            box_risk: None,
            tightening: if rigorous {
                TighteningSource::Drops
            } else {
                TighteningSource::Lipschitz
            },
            risk: None,
            share_draws: drops::share_draws(),
        },
        drops: DropsSection::default(),
        calibration: CalibrationSection::default(),
        deterministic: DeterministicSection::default(),
        slice,
        state: by_name(states, |_, i| state[i]),
        growth: GrowthSection {
            radius: 0.55,
            // Radii from a hundredth of the largest up: where balls of a tenth of it fail, smaller ones pass.
            rounds: if rigorous { 20 } else { 5 },
            scenarios,
            epsilon,
            beta,
            split_beta: rigorous,
            coordinates: Coordinates::All,
            boundary: if profile == Profile::Study {
                BoundarySearch::Slice
            } else {
                BoundarySearch::Rays
            },
            heading: Vec::new(),
            around: if rigorous { Around::Bound } else { Around::Set },
            method: if rigorous { GrowthMethod::Upward } else { GrowthMethod::Shrinking },
            shape: GrowthShape::Ball,
            factor: GrowthPlan::UPWARD.factor,
            pilot: GrowthPlan::UPWARD.pilot,
        },
        sequential: SequentialSection::default(),
        study: None,
        train: None,
        registry: Registry::default(),
        plan: Some(PlanSettings::default()),
        sources: Sources::default(),
    }
}

/// A slice axis.
pub(crate) fn axis(state: &str, from: f64, to: f64, step: f64) -> SliceAxisSection {
    SliceAxisSection { state: state.to_owned(), from, to, step }
}

/// A value for the name of each state.
fn by_name<T>(states: &[Axis], value: impl Fn(&Axis, usize) -> T) -> Named<T> {
    let entries = states.iter().enumerate();
    Named(entries.map(|(i, axis)| (axis.name.clone(), value(axis, i))).collect())
}

/// Owned names.
pub(crate) fn names<const N: usize>(names: [&str; N]) -> Vec<String> {
    names.map(str::to_owned).to_vec()
}
