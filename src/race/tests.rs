//! A small experiment to test with, what its settings refuse, and races that are flown alone.

use std::path::Path;

use super::controller::plan::Paths;
use super::controller::roster::{controller, settings};
use super::controller::{Decision, Name, World};
use super::flight::{Flight, fly, race_seed};
use super::judge::Judge;
use super::settings::{
    FilterSettings, FirstPlan, HybridSettings, NetworkFiles, NoPolicySettings, PlanSettings,
    RaceSettings, RecoveryPoint, SigmaSetting,
};
use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::control::tier::Domain;
use crate::files::StateReader;
use crate::model::{Model, Plant};
use crate::policy::Mlp;
use crate::race::barrier::{BarrierForm, Widening};
use crate::race::cost::{Fence, LaneCost, RaceCost, RecoveryCost, Safety};
use crate::race::system::DroneRace;
use crate::rollout::{NoiseKind, RolloutSpec};
use crate::scenario::Unwatched;
use crate::scenario::growth_plan::GrowthMethod;
use crate::scenario::settings::{ConstantSettings, Settings, SliceAxis};
use crate::system::System;

/// What a [`World`] borrows.
pub(super) struct Course {
    pub(super) backend: Backend,
    pub(super) system: DroneRace,
    pub(super) policy: Mlp,
    value: Mlp,
    pub(super) race: RaceSettings,
    pub(super) certificates: Settings,
}

impl Course {
    /// The trained networks; few samples, a coarse slice, growth in x and y of the ego.
    pub(super) fn new() -> Self {
        let system = DroneRace::default();
        let certificates = certificates(&system);
        let (policy, value) = (network("race_policy"), network("race_value"));
        let backend = Backend::Cpu(Cpu::new(Some(2)).unwrap());
        Self { backend, system, policy, value, race: race(), certificates }
    }

    pub(super) fn world(&self) -> World<'_> {
        let plant = Plant::of(self.system, self.policy.clone());
        // A course cannot hold what borrows its backend: a test leaves it behind.
        let program = Box::leak(Box::new(self.backend.prepare(&plant).unwrap()));
        World {
            backend: &self.backend,
            program,
            system: &self.system,
            policy: &self.policy,
            value: Some(&self.value),
            disturbance: None,
            ppo: Some(&self.policy),
            race: &self.race,
            certificates: &self.certificates,
        }
    }
}

/// A file of the shipped configurations.
fn shipped(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)
}

fn network(name: &str) -> Mlp {
    Mlp::load(&shipped(&format!("policies/{name}.safetensors"))).unwrap()
}

/// The first `count` starts of the study.
pub(super) fn study_starts(count: usize) -> Vec<[f32; 12]> {
    let names = DroneRace::default().states().map(|axis| axis.name);
    let path = shipped("race_starts_500.csv");
    StateReader::open(&path, names.to_vec()).unwrap().next(count).unwrap().arrays()
}

fn certificates(system: &DroneRace) -> Settings {
    let spec = RolloutSpec::new(30, 0.95).unwrap();
    let mut settings = Settings::new(&Model::of(*system), [0.0; 12], spec).expect("twelve states");
    settings.constants =
        ConstantSettings { target: Some(14.15), constraint: Some(14.43), ..Default::default() };
    settings.deviation.radius = 0.02;
    (settings.deviation.scenarios, settings.deviation.pilot) = (66, 32);
    let values = |low: f32, count: u16| (0..count).map(|i| low + 0.2 * f32::from(i)).collect();
    let axis = |(state, low, count)| SliceAxis { state, values: values(low, count) };
    settings.slice = Some([(0, -0.9, 10), (2, -2.6, 13)].map(axis));
    (settings.growth.rounds, settings.growth.scenarios) = (5, 81);
    settings.growth.varies = (0..12).map(|i| i == 0 || i == 2).collect();
    settings
}

fn plan(horizon: u32, speed: f32, cost: RaceCost) -> PlanSettings {
    PlanSettings {
        samples: 32,
        horizon,
        temperature: 10.0,
        sigma: SigmaSetting::Same(0.4),
        iterations: 1,
        noise: NoiseKind::Independent,
        antithetic: false,
        noise_cost: false,
        speed,
        cost,
    }
}

fn race() -> RaceSettings {
    let (safety, fence) = (Safety { weight: 10.0, ..Safety::NONE }, Fence::NONE);
    let (lane, away, wide, last) = (25e3, 5e4, 5e4, 1e4);
    let (speed, control) = (0.5, 1e-3);
    let fast = RaceCost::Lane(LaneCost { lane, speed, control, away, wide, last, safety, fence });
    let (position, velocity, control) = (5.0, 1.0, 0.1);
    let steady = RaceCost::Recovery(RecoveryCost { position, velocity, control, safety, fence });
    RaceSettings {
        steps: 30,
        judge: Judge::Study,
        beta: 0.1,
        starts: String::new(),
        start_box: Vec::new(),
        networks: NetworkFiles::default(),
        hybrid: HybridSettings {
            global: true,
            domain: Domain::Anywhere,
            local: true,
            growth: GrowthMethod::Shrinking,
            recovery_tier: true,
            latch: true,
            near_gate: true,
            near_gate_speed: 0.7,
            first_plan: FirstPlan::Brake,
            recovery_point: RecoveryPoint::Verified,
            plan_gain: 2.0,
            hold_opponent: true,
            value_weight: 1e6,
            value_threshold: -0.02,
            recovery: plan(12, 0.7, steady),
            fast: plan(10, 0.5, fast),
        },
        // Two horizons: a plan handed over from one to the other changes its length.
        no_policy: NoPolicySettings { recovery: plan(14, 0.7, fast), fast: plan(9, 0.5, fast) },
        mppi: plan(11, 0.7, fast),
        soft: plan(11, 0.7, fast),
        cbf: plan(11, 0.7, fast),
        warmstart: plan(11, 0.7, fast),
        warmstart_works: true,
        filter: FilterSettings {
            form: BarrierForm::TwoStep,
            widening: Widening::Heights,
            rate: 0.6,
            slack_weight: 1e5,
            radius: 0.2,
        },
    }
}

/// Races of `name` from `starts`, without the time they took.
fn flown(course: &Course, name: Name, starts: &[[f32; 12]], seeds: &[u64]) -> Vec<Flight> {
    let race = settings(name, &course.race);
    let world = World { race: &race, ..course.world() };
    let mut pilot = controller(name, world, starts.len(), Paths::None).unwrap();
    let steps = race.steps;
    let flights = fly(pilot.as_mut(), &course.system, starts, seeds, steps, &Unwatched);
    let untimed = |mut flight: Flight| {
        flight.decisions.iter_mut().for_each(|decision| decision.seconds = 0.0);
        flight
    };
    flights.unwrap().into_iter().map(untimed).collect()
}

#[test]
fn a_race_flown_alone_is_the_race_of_the_batch() {
    let course = Course::new();
    let starts = study_starts(9);
    let seeds: Vec<u64> = (0..9).map(|i| race_seed(7, i)).collect();
    for name in Name::STUDY.into_iter().chain([Name::HybridNoGlobal]) {
        let batch = flown(&course, name, &starts, &seeds);
        // 9 races fill no tile; 1 and 3 are other shapes of batch than 9.
        for chosen in [&[4][..], &[8], &[2, 5, 7]] {
            let some = |all: &[_]| chosen.iter().map(|&i| all[i]).collect::<Vec<[f32; 12]>>();
            let own: Vec<u64> = chosen.iter().map(|&i| seeds[i]).collect();
            let alone = flown(&course, name, &some(&starts), &own);
            for (&i, alone) in chosen.iter().zip(&alone) {
                assert!(alone.decisions.len() > 9, "{name:?} {i}");
                assert_eq!(alone.states, batch[i].states, "{name:?}, start {i}");
                assert_eq!(alone.decisions, batch[i].decisions, "{name:?}, start {i}");
            }
        }
    }
    // The seed decides, where there is noise.
    let other = flown(&course, Name::Mppi, &starts[4..5], &seeds[3..4]);
    let same = flown(&course, Name::Mppi, &starts[4..5], &seeds[4..5]);
    assert_ne!(other[0].states, same[0].states);
}

#[test]
fn states_follow_from_the_controls() {
    let course = Course::new();
    let starts = study_starts(4);
    for flight in flown(&course, Name::HybridNoPolicy, &starts, &[1, 2, 3, 4]) {
        let Flight { states, decisions } = flight;
        assert_eq!(states.len(), decisions.len() + 1);
        for ((x, decision), next) in states.iter().zip(&decisions).zip(&states[1..]) {
            let Decision { control, .. } = decision;
            assert!(x[2] < 0.0 && control.iter().all(|u| u.abs() <= 1.0));
            assert_eq!(course.system.step(*x, *control), *next);
        }
    }
}

#[test]
fn each_setting_out_of_range_is_named() {
    type Change = fn(&mut RaceSettings);
    let course = Course::new();
    course.race.check(&course.system).unwrap();
    let cases: [(Change, &str); 12] = [
        (|race| race.steps = 0, "race.steps: 0 is not within 1..=10000"),
        (|race| race.steps = 10_001, "race.steps: 10001"),
        (|race| race.beta = 1.0, "race.beta: 1 is not"),
        (|race| race.beta = 0.0, "race.beta: 0 is not"),
        (|race| race.hybrid.recovery.samples = 0, "race.hybrid.recovery.samples: 0"),
        (|race| race.hybrid.fast.horizon = 513, "race.hybrid.fast.horizon: 513"),
        (|race| race.no_policy.recovery.iterations = 0, "race.no_policy.recovery.iterations: 0"),
        (|race| race.no_policy.fast.temperature = 0.0, "race.no_policy.fast.temperature: 0"),
        (|race| race.soft.sigma = SigmaSetting::Same(-1.0), "race.soft.sigma: control 0 has -1"),
        (|race| race.cbf.noise = NoiseKind::Colored { time: 0.0 }, "race.cbf.noise.time: 0"),
        (|race| race.warmstart.noise = NoiseKind::Spline { knots: 12 }, "race.warmstart.noise.k"),
        (|race| race.filter.rate = 1.5, "race.filter.rate: 1.5"),
    ];
    for (change, words) in cases {
        let mut race = course.race.clone();
        change(&mut race);
        let message = race.check(&course.system).unwrap_err().to_string();
        assert!(message.starts_with(words), "{words}: {message}");
    }
}
