//! Measures of starts: who reaches the target, and by how much. `cargo run --release --example measures`

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::rollout::RolloutSpec;
use reachcast::system::{BangBang, DoubleIntegrator};

/// The measure of each of a few starts of a mass on a line, 4 seconds long.
pub(crate) fn measures(backend: &Backend, starts: &[[f32; 2]]) -> Result<Vec<f32>> {
    let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    // Prepared once, called any number of times.
    let program = backend.prepare(&plant)?;
    program.measures(starts, &RolloutSpec::new(40, 1.0)?)
}

fn main() -> Result<()> {
    // Position, m, and velocity, m/s.
    let starts = [[0.0, 0.0], [0.9, 0.0], [0.9, 1.0], [-0.5, 1.2]];
    let measures = measures(&Backend::auto()?, &starts)?;
    for ([position, velocity], measure) in starts.into_iter().zip(measures) {
        let word = if measure > 0.0 { "reaches" } else { "does not reach" };
        println!("from {position:4} m at {velocity:3} m/s it {word} the target: {measure:.3}");
    }
    Ok(())
}
