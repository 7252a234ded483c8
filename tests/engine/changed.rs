//! Plants and plans of Rust types whose data is changed afterwards run as what they say.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::sync::Arc;

use crate::common::{backends, cpu};
use reachcast::backend::Backend;
use reachcast::formula::{Expr, record};
use reachcast::model::{Controller, Law, Model, Plant};
use reachcast::race::{DroneRace, RaceCost, RaceReference, RecoveryCost};
use reachcast::race::{Fence, Safety, SafetyCone};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, Planning, Purpose, RolloutSpec,
    Stream,
};
use reachcast::system::{BangBang, DoubleIntegrator, System};

const STARTS: [[f32; 2]; 4] = [[0.5, 0.0], [-0.7, 0.2], [0.9, -0.4], [0.3, 0.9]];

fn plant(system: DoubleIntegrator) -> Plant {
    Plant::of(system, BangBang { acceleration: 1.0 })
}

fn measures(backend: &Backend, plant: &Plant) -> Vec<f32> {
    let spec = RolloutSpec::new(12, 1.0).unwrap();
    backend.prepare(plant).unwrap().measures(&STARTS, &spec).unwrap()
}

/// The plant with its model changed.
fn changed(change: impl FnOnce(&mut Model)) -> Plant {
    let mut plant = plant(DoubleIntegrator::default());
    change(Arc::make_mut(&mut plant.model));
    plant
}

#[test]
fn another_parameter_or_formula_counts() {
    let wider = plant(DoubleIntegrator { target: 0.6, ..DoubleIntegrator::default() });
    let by_hand = changed(|model| model.parameters[0].value = 0.6);
    let nowhere = changed(|model| {
        model.target =
            record(model.inputs(), |inputs| vec![Expr::lit(-1.0) + Expr::lit(0.0) * inputs[0]]);
    });
    let mut drifting = plant(DoubleIntegrator::default());
    let law = record(drifting.model.inputs(), |inputs| vec![inputs[0]]);
    drifting.controller = Arc::new(Controller::new("drift", Law::Formula(law.clone())));
    let mut replaced = plant(DoubleIntegrator::default());
    Arc::make_mut(&mut replaced.controller).law = Law::Formula(law);
    for backend in backends() {
        let before = measures(&backend, &plant(DoubleIntegrator::default()));
        assert_eq!(measures(&backend, &by_hand), measures(&backend, &wider));
        assert!(measures(&backend, &by_hand) != before);
        assert!(measures(&backend, &nowhere).iter().all(|measure| *measure <= -1.0));
        assert_eq!(measures(&backend, &replaced), measures(&backend, &drifting));
        assert!(measures(&backend, &replaced) != before);
    }
}

#[test]
fn plans_of_another_parameter_are_of_that() {
    let planning = |system: &DroneRace| {
        let safety = Safety { weight: 50.0, radius: 0.2, margin: 0.3, cone: SafetyCone::Either };
        let fence = Fence { weight: 20.0, margin: 0.1 };
        let cost = RecoveryCost { position: 5.0, velocity: 1.0, control: 0.1, safety, fence };
        let settings = MppiSettings::new(&system.controls(), 300, 6);
        Planning::of(system, RaceCost::Recovery(cost), MppiSpec::new(settings).unwrap())
    };
    let strong = DroneRace { ego_gain: 4.0, ..DroneRace::default() };
    let (expected, mut changed) = (planning(&strong), planning(&DroneRace::default()));
    let model = Arc::make_mut(&mut changed.model);
    let gain = model.parameters.iter_mut().find(|parameter| parameter.name == "ego_gain").unwrap();
    gain.value = 4.0;
    // The compiled stages of one system under the model of another.
    let mixed = Planning { model: Arc::new(Model::of(strong)), ..planning(&DroneRace::default()) };
    let start = [0.3, 0.05, -1.2, 0.6, 0.05, -0.02, -0.2, 0.0, -1.0, 0.4, 0.1, 0.0];
    let context = [RaceReference { speed: 0.5, ..RaceReference::default() }.context(); 6];
    let stream = Stream::new(7, Purpose::CONTROL_NOISE, 0);
    let problem = MppiProblem::new(start, &[[0.1, 0.2, -0.1]; 6], &context, stream);
    let problems = std::slice::from_ref(&problem);
    let task = MppiTask { problems, iteration: 0, costs: CostQuery::Each };
    let backend = cpu(1);
    let costs = |planning: &Planning| {
        backend.prepare_plans(planning).unwrap().improve(&task).unwrap().remove(0).costs
    };
    assert_eq!(costs(&changed), costs(&expected));
    assert_eq!(costs(&mixed), costs(&expected));
    assert!(costs(&planning(&DroneRace::default())) != costs(&expected));
}
