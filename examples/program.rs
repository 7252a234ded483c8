//! A program of one's own: every command of `reachcast` for a plant that is written in Rust.
//! `cargo run --release --example program -- certify examples/sled.toml --out sled`

use std::process::ExitCode;

use reachcast::Result;
use reachcast::config::{Registered, Registry};
use reachcast::cost::Cost;
use reachcast::model::{Controller, Costs, Model, StageCost};
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::system::{Axis, Clipped, Parameter, System};

/// A mass that slides with friction and is pushed to the middle of its track.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sled {
    drag: f32,
}

impl System<2, 1> for Sled {
    fn name(&self) -> &str {
        "sled"
    }
    fn states(&self) -> [Axis; 2] {
        let axis = Axis::new;
        [axis("position", "m", -1.0, 1.0), axis("velocity", "m/s", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("force", "N", -1.0, 1.0)]
    }
    // What is a parameter is an input of the formulas: another value compiles no kernel anew.
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new("drag", "1/s", self.drag)]
    }
    #[inline(always)]
    fn step<R: Real>(&self, [x, v]: [R; 2], [force]: [R; 1]) -> [R; 2] {
        let period = R::lit(0.1);
        let drag = R::parameter("drag", self.drag);
        [x + period * v, v + period * (force - drag * v)]
    }
    #[inline(always)]
    fn target<R: Real>(&self, [x, v]: [R; 2]) -> R {
        R::lit(0.1) - x.hypot(v)
    }
    #[inline(always)]
    fn constraint<R: Real>(&self, [x, _]: [R; 2]) -> R {
        R::lit(1.5) - x.abs()
    }
}

/// Pushes against position and velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Push;

impl Policy<2, 1> for Push {
    fn name(&self) -> String {
        "push".to_owned()
    }
    #[inline(always)]
    fn control<R: Real>(&self, [x, v]: [R; 2]) -> [R; 1] {
        [-x - R::lit(1.5) * v]
    }
}

/// What a plan pays: the distance from rest in the middle, and the force.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near;

impl Cost<2, 1, 0> for Near {
    #[inline(always)]
    fn stage<R: Real>(&self, [x, v]: [R; 2], [force]: [R; 1], _: [R; 0]) -> R {
        x * x + R::lit(0.3) * v * v + R::lit(0.01) * force * force
    }
}

/// What `[system] name = "sled"` and its key `drag` stand for.
pub(crate) fn registry() -> Result<Registry> {
    Registry::new().with("sled", |numbers| {
        let sled = Clipped::new(Sled { drag: numbers.number("drag", 0.2) as f32 });
        let (push, near) = (Controller::of(&sled, Push), StageCost::of(sled.clone(), Near));
        let model = Model::of(sled);
        let costs = Costs::of(&model, near, Vec::new())?;
        Ok(Registered::new(model).formula("push", push).costs(costs))
    })
}

fn main() -> Result<ExitCode> {
    Ok(reachcast::cli::run_with(&registry()?, std::env::args_os()).into())
}
