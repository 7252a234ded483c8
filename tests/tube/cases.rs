//! Plants that tubes are tried on, and starts of them.

use std::path::Path;

use reachcast::model::{Plant, text};
use reachcast::policy::Mlp;
use reachcast::race::DroneRace;
use reachcast::rollout::{
    PairControl, Purpose, Region, RolloutSpec, StateList, Stream, Tightening, replay,
};
use reachcast::scenario::deterministic::{Deterministic, Kind};
use reachcast::system::{Axis, BangBang, DoubleIntegrator};

use crate::common::race_policy;

pub(crate) fn spec(horizon: u32) -> RolloutSpec {
    RolloutSpec::new(horizon, 0.95).unwrap()
}

/// A carried file of `configs`.
pub(crate) fn carried(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)
}

pub(crate) fn race() -> Plant {
    Plant::of(DroneRace::default(), race_policy())
}

pub(crate) fn bang_bang() -> Plant {
    Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 })
}

pub(crate) fn learned() -> Plant {
    let network = Mlp::load(&carried("policies/double_integrator_policy.safetensors")).unwrap();
    Plant::of(DoubleIntegrator::default(), network)
}

pub(crate) fn dubins() -> Plant {
    let written = std::fs::read_to_string(carried("models/dubins.toml")).unwrap();
    text::read(&written, "dubins.toml", Path::new(".")).unwrap().plant().unwrap()
}

/// Starts over the default box of the plant.
pub(crate) fn starts(plant: &Plant, count: u64) -> StateList {
    let side = |end: fn(&Axis) -> f32| plant.model.states.iter().map(end).collect::<Vec<f32>>();
    let region = Region::new_box(side(|axis| axis.low), side(|axis| axis.high)).unwrap();
    let stream = Stream::new(7, Purpose::USER, 3);
    StateList::new(plant.model.states.len()).with((0..count).map(|i| region.point(stream, i)))
}

/// A plant, how it is driven, steps, kind, and the radius that its tests look at.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) plant: Plant,
    pub(crate) control: PairControl,
    pub(crate) horizon: u32,
    pub(crate) kind: Kind,
    pub(crate) most: f64,
}

pub(crate) fn cases() -> [Case; 5] {
    use PairControl::{ClosedLoop, Replay};
    let case = |name, plant, control, horizon, kind, most| Case {
        name,
        plant,
        control,
        horizon,
        kind,
        most,
    };
    [
        case("race, replay", race(), Replay, 30, Kind::Pieces, 0.3),
        case("race, network", race(), ClosedLoop, 30, Kind::Tube, 0.1),
        case("double integrator", bang_bang(), ClosedLoop, 30, Kind::Tube, 0.3),
        case("double integrator, network", learned(), ClosedLoop, 30, Kind::Tube, 0.3),
        case("dubins", dubins(), ClosedLoop, 60, Kind::Tube, 0.2),
    ]
}

/// Certified radii of the first starts of a case that have one.
pub(crate) fn with_radii(case: &Case, count: usize) -> Vec<(Vec<f32>, f64)> {
    let certificate =
        Deterministic::new(&case.plant, spec(case.horizon), case.control, case.kind).unwrap();
    let none = Tightening::none(&spec(case.horizon));
    let starts = starts(&case.plant, 40 * count as u64);
    let succeeds = |x: &&[f32]| replay::measure(&case.plant, x, &spec(case.horizon), &none) > 0.0;
    let reached: Vec<&[f32]> = starts.iter().filter(succeeds).take(count).collect();
    let list = StateList::new(starts.view().size()).with(reached);
    let radii = certificate.radii(list.view(), case.most);
    list.iter().map(<[f32]>::to_vec).zip(radii).collect()
}
