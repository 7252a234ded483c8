//! The carried plants as text: the same graphs as those recorded from Rust, and the same bits.

use std::array::from_fn;
use std::path::Path;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::formula::Graph;
use reachcast::model::text::{Description, read};
use reachcast::model::{Controller, Law, Model};
use reachcast::policy::{Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::system::{BangBang, DoubleIntegrator, System};

#[path = "../../examples/certificate.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod dubins;

/// The description of a file under `configs/models`.
fn carried(name: &str) -> Description {
    let folder = Path::new("configs/models");
    let text = std::fs::read_to_string(folder.join(name)).expect("a file");
    read(&text, name, folder).expect("a description")
}

/// The outputs of `graph` as bits, in f32 and in f64.
fn bits(graph: &Graph, inputs: &[f32]) -> Vec<u64> {
    let wide: Vec<f64> = inputs.iter().map(|x| f64::from(*x)).collect();
    let narrow = graph.eval(inputs).into_iter().map(|y: f32| u64::from(y.to_bits()));
    narrow.chain(graph.eval(&wide).into_iter().map(f64::to_bits)).collect()
}

/// Requires the model of `name` to be that of `system`, graph by graph and bit by bit.
fn assert_same<S, const NX: usize, const NU: usize>(name: &str, system: S)
where
    S: System<NX, NU> + Clone + Send + Sync + 'static,
{
    let (text, mut rust) = (carried(name).model().expect("a model"), Model::of(system.clone()));
    let graphs = |model: &Model| [&model.step, &model.target, &model.constraint].map(Clone::clone);
    let values = text.values();
    let mut random = StdRng::seed_from_u64(1);
    for _ in 0..2000 {
        let mut draw = || random.random_range(-2.5_f32..2.5);
        let (x, u): ([f32; NX], [f32; NU]) = (from_fn(|_| draw()), from_fn(|_| draw()));
        let time = [draw(), draw()];
        let inputs = [&x[..], &u, &values, &time].concat();
        for (text, rust) in graphs(&text).iter().zip(&graphs(&rust)) {
            assert_eq!(bits(text, &inputs), bits(rust, &inputs), "{name} at {inputs:?}");
        }
        let compiled = [&system.step(x, u)[..], &[system.target(x), system.constraint(x)]].concat();
        let recorded =
            graphs(&text).iter().flat_map(|graph| graph.eval(&inputs)).collect::<Vec<_>>();
        assert_eq!(compiled.map_bits(), recorded.map_bits(), "{name} compiled, at {inputs:?}");
    }
    // Printed as WGSL and hashed alike: the same operations in the same order.
    rust.period = text.period;
    assert_eq!(text, rust, "{name}");
}

/// Bits of numbers, which tell 0 from -0.
trait MapBits {
    fn map_bits(&self) -> Vec<u32>;
}

impl MapBits for Vec<f32> {
    fn map_bits(&self) -> Vec<u32> {
        self.iter().map(|x| x.to_bits()).collect()
    }
}

/// Requires the policy of `name` to be `policy`.
fn assert_same_policy<S, P, const NX: usize, const NU: usize>(name: &str, system: &S, policy: P)
where
    S: System<NX, NU>,
    P: Policy<NX, NU> + Send + Sync + 'static,
{
    let controller = carried(name).controller().expect("a policy");
    assert_eq!(controller.law, Controller::of(system, policy).law, "{name}");
}

#[test]
fn the_double_integrator_is_the_one_in_rust() {
    let system = DoubleIntegrator::default();
    assert_same("double_integrator.toml", system);
    assert_same_policy("double_integrator.toml", &system, BangBang { acceleration: 1.0 });
}

#[test]
fn the_dubins_car_is_that_of_the_example() {
    assert_same("dubins.toml", dubins::Dubins);
    assert_same_policy("dubins.toml", &dubins::Dubins, dubins::Steer);
}

#[test]
fn the_race_is_the_one_in_rust() {
    assert_same("drone_race.toml", DroneRace::default());
    let Law::Network { observe: None, network, act: None } =
        carried("drone_race.toml").controller().expect("a policy").law
    else {
        panic!("a bare network");
    };
    let file = Path::new("configs/policies/race_policy.safetensors");
    assert_eq!(*network, Mlp::load(file).expect("a network"));
}

/// Another value of a parameter is another system in Rust and the same graph.
#[test]
fn a_parameter_is_data() {
    let text = std::fs::read_to_string("configs/models/drone_race.toml").expect("a file");
    let other = text.replace("value = 0.5", "value = 0.7");
    let model = |text: &str| {
        let described = read(text, "race", Path::new("configs/models")).expect("a description");
        described.model().expect("a model")
    };
    let (before, mut after) = (model(&text), model(&other));
    assert_eq!((before.values(), after.values()), (vec![0.5, 1.0], vec![0.7, 1.0]));
    let faster = DroneRace { ego_gain: 0.7, ..DroneRace::default() };
    let (x, u) = ([0.5_f32; 12], [0.9; 3]);
    let inputs = [&x[..], &u, &after.values(), &[0.0; 2]].concat();
    assert_eq!(after.step.eval(&inputs), faster.step(x, u));
    after.parameters.clone_from(&before.parameters);
    assert_eq!(before, after);
}
