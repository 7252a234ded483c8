//! Systems as tapes against their compiled forms.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use crate::backend::cpu::interpreted::InterpretedSystem;
use crate::model::Model;
use crate::race::system::DroneRace;
use crate::real::simd::Instructions;
use crate::system::{DiffDrive, DoubleIntegrator, System};
use crate::tile::{Clock, CompiledSystem, Frame, Layout, NativeSystem};

/// A frame of random states and controls, some of which are not finite.
fn frame(layout: Layout, lanes: usize, seed: u64) -> Frame {
    let random = &mut StdRng::seed_from_u64(seed);
    let mut frame = Frame::new(layout, lanes);
    for place in frame.rows_mut() {
        *place = match random.random_range(0..50) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            _ => random.random_range(-3.0..3.0),
        };
    }
    frame
}

/// Ten steps of both forms, states and margins compared after each.
fn compare<S, const NX: usize, const NU: usize>(system: S)
where
    S: System<NX, NU> + Clone + Send + Sync + 'static,
{
    let model = Model::of(system.clone());
    let tapes = InterpretedSystem::new(&model, &model.values(), &|_| unreachable!("no networks"));
    assert_eq!(tapes.clock(), Clock::Ignored);
    let (compiled, own) = (CompiledSystem(system), tapes.own_rows());
    let layout = Layout { states: NX, controls: NU, own };
    for with in Instructions::detect() {
        for lanes in [1, 15, 16, 100, 256] {
            let mut frames = [frame(layout, lanes, 7), frame(layout, lanes, 7)];
            for _ in 0..10 {
                let [one, other] = &mut frames;
                compiled.step(with, one, lanes);
                compiled.margins(with, one, lanes);
                tapes.step(with, other, lanes);
                tapes.margins(with, other, lanes);
                for row in (0..NX).chain(layout.margins()) {
                    for (a, b) in one.row(row)[..lanes].iter().zip(other.row(row)) {
                        let equal = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
                        assert!(equal, "{}, row {row}: {a} and {b}", with.name());
                    }
                }
            }
        }
    }
}

#[test]
fn carried_plants() {
    compare(DoubleIntegrator::default());
    compare(DroneRace::default());
    compare(DiffDrive::default());
}
