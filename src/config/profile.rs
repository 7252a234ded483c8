//! Defaults: the numbers of each profile for each system, from the published study of the race.

use super::race::race;
use super::section::{
    Config, ConstantsSection, DeviationSection, GlobalSection, GrowthSection, PolicySection,
    Profile, RolloutSection, SliceAxisSection, SliceSection, SystemSection,
};
use super::sources::Sources;
use super::train;
use super::value::{Constant, Coordinates, Named};
use crate::rollout::PairControl;
use crate::scenario::record::decimal;
use crate::scenario::settings::{BoundarySearch, DeviationSource, Joint};
use crate::system::{Axis, Cone, DoubleIntegrator, DroneRace, System};

/// Names of the systems that a configuration can ask for.
pub(super) const SYSTEMS: [&str; 2] = ["drone-race", "double-integrator"];

/// Steps of a slice that nobody asked for.
const SLICE_STEPS: f64 = 20.0;

/// First of the 500 starts of the published study, `configs/race_starts_500.csv`.
const RACE_STATE: [f64; 12] = [
    0.7415519915922972,
    0.0,
    -1.0318051933867767,
    0.5269589927741894,
    -0.00831426835774926,
    -0.0925577927382397,
    -0.45164051298706803,
    0.0,
    -2.4884756227075835,
    0.31867728763257475,
    0.006058703491681097,
    -0.016398054808464832,
];

/// The defaults of `profile` for the system `name`, without a policy; none if it is unknown.
pub(super) fn defaults(profile: Profile, name: &str) -> Option<Config> {
    match name {
        "drone-race" => Some(drone_race(profile)),
        "double-integrator" => Some(double_integrator(profile)),
        _ => None,
    }
}

/// The race. Where the paper gives no number, `paper` has that of the study.
fn drone_race(profile: Profile) -> Config {
    let published = profile != Profile::Rigorous;
    let mut states = DroneRace::default().states();
    if published {
        (states[9].low, states[9].high) = (-1.0, 1.0);
    }
    let given = |value| {
        if published { Constant::Given(value) } else { Constant::Computed }
    };
    let slice = SliceSection { x: axis("ego_x", -0.9, 0.9, 0.1), y: axis("ego_y", -2.6, 0.0, 0.1) };
    let system = SystemSection::DroneRace {
        cone: if profile == Profile::Paper { Cone::Squared } else { Cone::Distance },
        ego_gain: if profile == Profile::Paper { 1.0 } else { 0.5 },
        opponent_gain: 1.0,
        speed_limit: profile == Profile::Study,
    };
    let mut config = common(profile, Some(system), &states, &RACE_STATE, slice);
    config.constants = ConstantsSection { target: given(10.0), constraint: given(20.0) };
    config.growth.heading = names(["ego_x", "ego_vx", "ego_y", "ego_vy"]);
    config.race = Some(race(profile));
    config.train = Some(train::race());
    if profile == Profile::Study {
        // The study scores the first 30 states of a rollout, 29 steps.
        config.rollout.horizon = 29;
        config.growth.coordinates = Coordinates::Named(names(["ego_x", "ego_y"]));
    }
    config
}

/// The double integrator; the published study has no such experiment, so the profiles differ in
/// their accounting alone.
fn double_integrator(profile: Profile) -> Config {
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
/// the first two states over their box in twenty steps; perturbations have a fiftieth of the
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
        SliceAxisSection { state: axis.name.clone(), from, to, step: (to - from) / SLICE_STEPS }
    };
    let [x, y] = [0, states.len().min(2) - 1].map(|i| cut(&states[i]));
    let widths = states.iter().map(|axis| decimal(axis.high) - decimal(axis.low));
    let narrowest = widths.filter(|width| *width > 0.0).fold(f64::INFINITY, f64::min);
    let narrowest = if narrowest.is_finite() { narrowest } else { 1.0 };
    let mut config = common(profile, None, states, &state, SliceSection { x, y });
    config.deviation.radius = narrowest / 50.0;
    config.growth.radius = narrowest / 4.0;
    config
}

/// What all systems share.
fn common(
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
        system,
        model: None,
        policy: PolicySection::default(),
        rollout: RolloutSection { horizon: 30, gamma: 0.95 },
        bounds: by_name(states, |axis, _| [decimal(axis.low), decimal(axis.high)]),
        constants: ConstantsSection { target: Constant::Computed, constraint: Constant::Computed },
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
        global: GlobalSection { draws: 20_000, beta },
        slice,
        state: by_name(states, |_, i| state[i]),
        growth: GrowthSection {
            radius: 0.55,
            // In twelve dimensions the nearest failure lies near the rim, so that balls shrink slowly
            // and five rounds seldom see a clean one. Beta is split over the rounds.
            rounds: if rigorous { 10 } else { 5 },
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
        },
        race: None,
        train: None,
        sources: Sources::default(),
    }
}

/// A slice axis.
fn axis(state: &str, from: f64, to: f64, step: f64) -> SliceAxisSection {
    SliceAxisSection { state: state.to_owned(), from, to, step }
}

/// A value for the name of each state.
fn by_name<T>(states: &[Axis], value: impl Fn(&Axis, usize) -> T) -> Named<T> {
    let entries = states.iter().enumerate();
    Named(entries.map(|(i, axis)| (axis.name.clone(), value(axis, i))).collect())
}

/// Owned names.
fn names<const N: usize>(names: [&str; N]) -> Vec<String> {
    names.map(str::to_owned).to_vec()
}
