//! A plant that is known at run time only: a text, read, prepared and rolled out with one parameter at
//! several values. `cargo run --release --example given_at_run_time`

use std::path::Path;
use std::sync::Arc;

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::model::{Plant, text};
use reachcast::rollout::RolloutSpec;

/// A boat that is pushed aside by a current, and steers for the middle of a gate.
const BOAT: &str = r#"
[model]
name = "boat"

[model.states]
across = { unit = "m", box = [-2.0, 2.0] }
drift = { unit = "m/s", box = [-0.5, 0.5] }

[model.controls]
push = { unit = "m/s^2", bounds = [-1.0, 1.0] }

[model.parameters]
current = { unit = "m/s^2", value = 0.1 }

[model.flow]
across = "drift"
drift = "push + current - 0.2 * drift"

[model.time]
period = 0.1
integrator = "rk4"

[model.task]
kind = "reach-avoid"
target = "0.2 - hypot(across, drift)"
constraint = "2.5 - abs(across)"

[policy]
formula = { push = "-across - 1.5 * drift" }
"#;

/// The measure of a start under each current, m/s^2: nothing is compiled anew for another value.
pub(crate) fn measures(backend: &Backend, currents: &[f32]) -> Result<Vec<f32>> {
    let boat = text::read(BOAT, "boat.toml", Path::new("."))?.plant()?;
    let spec = RolloutSpec::new(100, 1.0)?;
    let under = |current: &f32| {
        let mut model = (*boat.model).clone();
        model.parameters[0].value = *current;
        let plant = Plant { model: Arc::new(model), controller: boat.controller.clone() };
        Ok(backend.prepare(&plant)?.measures(&[[1.5, 0.0]], &spec)?[0])
    };
    currents.iter().map(under).collect()
}

fn main() -> Result<()> {
    let currents = [0.0, 0.1, 0.3, 0.9];
    for (current, measure) in currents.iter().zip(measures(&Backend::auto()?, &currents)?) {
        println!("current {current} m/s^2: measure {measure:.3}");
    }
    Ok(())
}
