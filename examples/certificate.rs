//! A system of one's own, from its definition to a certificate: a Dubins car, a round obstacle,
//! a hand-written policy. `cargo run --release --example certificate`

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::rollout::RolloutSpec;
use reachcast::scenario::{Unwatched, certify, record::Record, settings::Settings};
use reachcast::system::{Axis, Body, System};

/// A car of unit speed that steers with up to 1 rad/s; the state is (x, y, heading).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dubins;

impl System<3, 1> for Dubins {
    fn name(&self) -> &str {
        "dubins"
    }
    fn states(&self) -> [Axis; 3] {
        let axis = Axis::new;
        [axis("x", "m", -2.5, -1.5), axis("y", "m", -1.0, 1.0), axis("heading", "rad", -0.5, 0.5)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("turn_rate", "rad/s", -1.0, 1.0)]
    }
    #[inline(always)]
    fn step<R: Real>(&self, [x, y, heading]: [R; 3], [turn]: [R; 1]) -> [R; 3] {
        let turn = turn.clamp(R::lit(-1.0), R::lit(1.0));
        let dt = R::lit(0.1);
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
    fn bodies(&self) -> Vec<Body> {
        vec![Body { name: "car".to_owned(), x: 0, y: 1 }]
    }
}

/// Steers toward the target, pushed away from the obstacle where it is near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steer;

impl Policy<3, 1> for Steer {
    fn name(&self) -> String {
        "steer".to_owned()
    }
    #[inline(always)]
    fn control<R: Real>(&self, [x, y, heading]: [R; 3]) -> [R; 1] {
        let (to_x, to_y) = (R::lit(2.0) - x, -y);
        let push = (R::lit(1.3) - x.hypot(y)).max(R::lit(0.0)) * R::lit(8.0);
        let side = y.if_lt(R::lit(0.0), R::lit(-1.0), R::lit(1.0));
        let (want_x, want_y) = (to_x, to_y + push * side);
        let cross = heading.cos() * want_y - heading.sin() * want_x;
        [R::lit(3.0) * cross / want_x.hypot(want_y)]
    }
}

/// The certificate for starts left of the obstacle, 6 seconds to reach the target.
pub(crate) fn certificate(backend: &Backend) -> Result<Record> {
    let spec = RolloutSpec::new(60, 0.98)?;
    let plant = Plant::of(Dubins, Steer);
    let mut settings = Settings::new(&plant.model, [-2.4, 0.9, 0.4], spec)?;
    settings.deviation.radius = 0.02;
    settings.global.draws = 4000;
    certify(&backend.prepare(&plant)?, &settings, "dubins".into(), &Unwatched)
}

fn main() -> Result<()> {
    let record = certificate(&Backend::auto()?)?;
    println!("{}", record.statements.join("\n"));
    Ok(())
}
