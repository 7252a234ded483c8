//! Systems as tapes against their compiled forms.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::{Clock, CompiledSystem, Frame, InterpretedSystem, Layout, NativeSystem};
use crate::model::Model;
use crate::real::simd::Instructions;
use crate::system::{DiffDrive, DoubleIntegrator, DroneRace, System};

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
    let tapes = InterpretedSystem::new(&model, &model.values());
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

mod scratch {
    use super::*;
    use crate::policy::Policy;
    use crate::real::Real;
    use std::time::Instant;

    #[derive(Clone)]
    struct Dubins;
    impl System<3, 1> for Dubins {
        fn name(&self) -> &str {
            "dubins"
        }
        fn states(&self) -> [crate::system::Axis; 3] {
            std::array::from_fn(|_| crate::system::Axis::new("x", "m", 0.0, 1.0))
        }
        fn controls(&self) -> [crate::system::Axis; 1] {
            [crate::system::Axis::new("turn_rate", "rad/s", -1.0, 1.0)]
        }
        #[inline(always)]
        fn step<R: Real>(&self, [x, y, heading]: [R; 3], [turn]: [R; 1]) -> [R; 3] {
            let dt = R::lit(0.1);
            let turn = turn.clamp(R::lit(-1.0), R::lit(1.0));
            [x + dt * heading.cos(), y + dt * heading.sin(), heading + dt * turn]
        }
        #[inline(always)]
        fn target<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
            R::lit(0.5) - (x - R::lit(2.0)).hypot(y)
        }
        #[inline(always)]
        fn constraint<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
            x.hypot(y) - R::lit(0.5)
        }
    }
    #[derive(Clone)]
    struct Quad;
    impl System<12, 4> for Quad {
        fn name(&self) -> &str {
            "quad"
        }
        fn states(&self) -> [crate::system::Axis; 12] {
            std::array::from_fn(|_| crate::system::Axis::new("x", "m", 0.0, 1.0))
        }
        fn controls(&self) -> [crate::system::Axis; 4] {
            std::array::from_fn(|_| crate::system::Axis::new("x", "m", 0.0, 1.0))
        }
        #[inline(always)]
        fn step<R: Real>(&self, s: [R; 12], u: [R; 4]) -> [R; 12] {
            let [x, y, z, vx, vy, vz, a, b, c, p, q, r] = s;
            let dt = R::lit(0.02);
            let one = R::lit(1.0);
            let u = u.map(|u| u.clamp(R::lit(-1.0), R::lit(1.0)));
            let thrust = R::lit(9.81) * (one + u[0]);
            let (sa, ca, sb, cb, sc, cc) = (a.sin(), a.cos(), b.sin(), b.cos(), c.sin(), c.cos());
            [
                x + dt * vx,
                y + dt * vy,
                z + dt * vz,
                vx + dt * (thrust * (cc * sb * ca + sc * sa)),
                vy + dt * (thrust * (sc * sb * ca - cc * sa)),
                vz + dt * (thrust * (cb * ca) - R::lit(9.81)),
                a + dt * (p + (q * sa + r * ca) * (sb / cb)),
                b + dt * (q * ca - r * sa),
                c + dt * ((q * sa + r * ca) / cb),
                p + dt * (R::lit(-0.7) * q * r + R::lit(10.0) * u[1]),
                q + dt * (R::lit(0.7) * p * r + R::lit(10.0) * u[2]),
                r + dt * (R::lit(0.05) * p * q + R::lit(5.0) * u[3]),
            ]
        }
        #[inline(always)]
        fn target<R: Real>(&self, s: [R; 12]) -> R {
            R::lit(0.5) - s[0].hypot(s[1]).hypot(s[2] - R::lit(1.0))
        }
        #[inline(always)]
        fn constraint<R: Real>(&self, s: [R; 12]) -> R {
            s[2].min(R::lit(0.6) - s[6].abs()).min(R::lit(0.6) - s[7].abs())
        }
    }

    fn time(with: Instructions, system: &dyn NativeSystem, layout: Layout, lanes: usize) -> f64 {
        let start = {
            let mut f = Frame::new(layout, lanes);
            f.rows_mut().fill(0.1);
            f
        };
        let mut best = f64::INFINITY;
        for _ in 0..300 {
            let mut f = Frame::new(layout, lanes);
            f.rows_mut()[..layout.rows() * lanes]
                .copy_from_slice(&start.rows()[..layout.rows() * lanes]);
            let t = Instant::now();
            for _ in 0..20 {
                system.step(with, &mut f, lanes);
                system.margins(with, &mut f, lanes);
            }
            best = best.min(t.elapsed().as_secs_f64() / 20.0 / lanes as f64);
        }
        best * 1e9
    }

    fn plant<S, const NX: usize, const NU: usize>(name: &str, system: S)
    where
        S: System<NX, NU> + Clone + Send + Sync + 'static,
    {
        let model = Model::of(system.clone());
        let tapes = InterpretedSystem::new(&model, &model.values());
        let own = tapes.own_rows();
        let layout = Layout { states: NX, controls: NU, own };
        println!(
            "{name}: {} nodes, {:?} steps, own {own}",
            model.step.nodes.len() + model.target.nodes.len() + model.constraint.nodes.len(),
            tapes.sizes()
        );
        for with in Instructions::detect() {
            for lanes in [64, 128, 256, 512] {
                let a = time(with, &CompiledSystem(system.clone()), layout, lanes);
                let b = time(with, &tapes, layout, lanes);
                println!(
                    "  {:24} {lanes:4} lanes: compiled {a:6.2} ns, tape {b:6.2} ns, ratio {:.2}",
                    with.name(),
                    a / b
                );
            }
        }
    }

    #[test]
    #[ignore]
    fn scratch_times() {
        plant("race", DroneRace::default());
        plant("dubins", Dubins);
        plant("quad", Quad);
        plant("diff drive", DiffDrive::default());
    }
}
