//! What a whole run prepares on an adapter: each plant, each planning and each kernel once.

use std::sync::Arc;

use reachcast::backend::Backend;
use reachcast::backend::gpu::Traffic;
use reachcast::backend::gpu::compose::Kernel;
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::race::bench::data;
use reachcast::rollout::{CostQuery, MppiTask, Planning, RolloutSpec, ValueTerm};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Unwatched, certify};
use reachcast::system::{BangBang, DoubleIntegrator};

use crate::{gpu, random_network};

fn traffic(backend: &Backend) -> Traffic {
    match backend {
        Backend::Gpu(gpu) => gpu.traffic(),
        Backend::Cpu(_) => Traffic::default(),
    }
}

/// A certificate rolls out thousands of balls, pairs and starts: one program, each kernel compiled once.
#[test]
fn a_certificate_prepares_its_plant_once() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant::of(DoubleIntegrator::default(), policy);
    let spec = RolloutSpec::new(40, 0.99).expect("a horizon");
    let mut settings = Settings::new(&plant.model, [0.9, 0.0], spec).expect("settings");
    settings.global.draws = 500;
    let made = || {
        let program = backend.prepare(&plant).expect("it fits");
        certify(&program, &settings, "a test".into(), &Unwatched).expect("a certificate")
    };
    let before = traffic(&backend);
    let first = made();
    let once = traffic(&backend).since(before);
    assert_eq!(once.programs, 1);
    let kernels = Kernel::ROLLOUT.len() as u64;
    assert!((1..=kernels).contains(&once.pipelines), "{once:?}");
    let before = traffic(&backend);
    let second = made();
    let Traffic { programs, texts, packs, pipelines, .. } = traffic(&backend).since(before);
    assert_eq!([programs, texts, packs, pipelines], [0; 4]);
    assert_eq!(first.global, second.global);
}

/// Equal plannings are one program, whoever asks for them; another threshold is another.
#[test]
fn a_planning_is_prepared_once() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let network = Arc::new(random_network(&[12, 20, 1], Activation::Tanh));
    let planning = |threshold| {
        let value = Some(ValueTerm { network: Arc::clone(&network), weight: 4.0, threshold });
        let spec = data::mppi_spec(64).expect("settings");
        Planning { value, ..Planning::of(&DroneRace::default(), data::lane(), spec) }
    };
    let problems = [data::mppi_problem(1, 0)];
    let improve = |threshold| {
        let program = backend.prepare_plans(&planning(threshold)).expect("it fits");
        let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Summary };
        program.improve(&task).expect("it runs")
    };
    let before = traffic(&backend);
    let first = improve(0.3);
    let once = traffic(&backend).since(before);
    assert_eq!((once.programs, once.packs), (1, 1));
    let before = traffic(&backend);
    assert_eq!(improve(0.3), first);
    let again = traffic(&backend).since(before);
    let Traffic { programs, packs, pipelines, buffers, groups, .. } = again;
    assert_eq!([programs, packs, pipelines, buffers, groups], [0; 5], "{again:?}");
    assert_ne!(improve(5.0), first);
    assert_eq!(traffic(&backend).since(before).programs, 1);
}
