//! What the tests of training share: configurations, and what is trained on them.

#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::sync::Arc;

use reachcast::backend::Backend;
use reachcast::config::{Config, Overrides};
use reachcast::model::{Interface, Model};
use reachcast::policy::Activation;
use reachcast::rollout::{RolloutSpec, Stream, Tightening};
use reachcast::system::System;
use reachcast::train::analytic::Task;
use reachcast::train::device::Device;
use reachcast::train::network::{Architecture, Network};
use reachcast::train::purpose;
use reachcast::train::settings::TrainSettings;

/// The configuration of a system with its defaults.
pub(crate) fn config(system: &str, method: &str, set: &[&str]) -> Config {
    let text = format!("seed = 5\nsystem.name = '{system}'\n[train]\nmethod = '{method}'\n");
    let set = set.iter().map(ToString::to_string).collect();
    let overrides = Overrides { set, ..Overrides::default() };
    Config::from_table(toml::from_str(&text).unwrap(), "test", &overrides).unwrap()
}

/// What `config` says about training.
pub(crate) fn settings(config: &Config) -> &TrainSettings {
    config.train_settings().unwrap()
}

/// The intervals of the states.
pub(crate) fn intervals<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
) -> Vec<[f32; 2]> {
    system.states().iter().map(|axis| [axis.low, axis.high]).collect()
}

/// A random policy, its last layer `last` times as large as the others.
pub(crate) fn random<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    hidden: &[usize],
    last: f32,
) -> Network {
    let (inputs, hidden) = (intervals(system), hidden.to_vec());
    let (activation, output) = (Activation::Relu, Activation::Tanh);
    let shape = Architecture { inputs, hidden, outputs: NU, activation, output };
    Network::random(shape, Stream::new(5, purpose::WEIGHT, 0), last)
}

/// What is trained on `system`, its tensors on `device`.
pub(crate) fn task<
    'a,
    S: System<NX, NU> + Clone + Send + Sync + 'static,
    const NX: usize,
    const NU: usize,
>(
    system: &S,
    backend: &'a Backend,
    device: &Device,
    config: &Config,
) -> Task<'a> {
    Task {
        model: Arc::new(Model::of(system.clone())),
        interface: Interface::plain(&Model::of(system.clone())),
        backend,
        device: device.clone(),
        spec: config.spec().unwrap(),
        tightening: None,
        mixture: config.mixture(&system.states()).unwrap(),
        held_out: settings(config).held_out,
        seed: config.seed,
    }
}

/// Losses that grow over the steps.
pub(crate) fn losses(spec: &RolloutSpec) -> Tightening {
    let grown = |rate: f32| (0..=spec.horizon).map(|t| rate * (t as f32).sqrt()).collect();
    Tightening::losing(grown(0.3), grown(0.2))
}
