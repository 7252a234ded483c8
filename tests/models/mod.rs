//! Plants as data that read everything that a formula can: parameters, time, the number of the step,
//! what a network sees and says; and the same in f64, written from the mathematics.

#![allow(dead_code, reason = "each test file uses a part of it")]

use std::sync::Arc;

use reachcast::formula::{Expr, Graph, record};
use reachcast::model::{Controller, Law, Model, Parameter, Plant};
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::real::Real;
use reachcast::rollout::{PairControl, RolloutSpec, Tightening};
use reachcast::system::{Axis, System};

/// What the model is recorded from: the formulas are replaced.
struct Outline;

impl System<3, 2> for Outline {
    fn name(&self) -> &str {
        "drift"
    }
    fn states(&self) -> [Axis; 3] {
        ["x", "y", "heading"].map(|name| Axis::new(name, "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 2] {
        ["speed", "turn"].map(|name| Axis::new(name, "m/s", -1.0, 1.0))
    }
    fn step<R: Real>(&self, x: [R; 3], _: [R; 2]) -> [R; 3] {
        x
    }
    fn target<R: Real>(&self, [x, ..]: [R; 3]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [x, ..]: [R; 3]) -> R {
        x
    }
    fn parameters(&self) -> Vec<Parameter> {
        let named = [("wind", 0.3), ("gain", 0.8), ("radius", 1.1), ("wall", 2.5), ("pull", 0.4)];
        named.map(|(name, value)| Parameter::new(name, "", value)).to_vec()
    }
}

/// Seconds between two steps.
pub(crate) const PERIOD: f32 = 0.125;

/// A formula's inputs of the drift, by name.
struct Named<'a, R> {
    x: &'a [R],
    u: &'a [R],
    p: &'a [R],
    t: R,
    step: R,
}

impl<'a, R: Real> Named<'a, R> {
    fn new(inputs: &'a [R]) -> Self {
        let (x, rest) = inputs.split_at(3);
        let (u, rest) = rest.split_at(2);
        let (p, rest) = rest.split_at(5);
        Self { x, u, p, t: rest[0], step: rest[1] }
    }
}

/// A point driven by speed and turn in a wind that turns with time.
fn step<R: Real>(inputs: &[R]) -> Vec<R> {
    let Named { x, u, p, t, .. } = Named::new(inputs);
    let [wind, gain] = [p[0], p[1]];
    let period = R::lit(PERIOD);
    vec![
        x[0] + period * (gain * u[0] * x[2].cos() + wind * t.sin()),
        x[1] + period * gain * u[0] * x[2].sin(),
        x[2] + period * u[1],
    ]
}

/// Within a radius of a point that moves away step by step.
fn target<R: Real>(inputs: &[R]) -> R {
    let Named { x, p, step, .. } = Named::new(inputs);
    p[2] - (x[0] - R::lit(0.05) * step).hypot(x[1])
}

/// This side of a wall that comes nearer with time.
fn constraint<R: Real>(inputs: &[R]) -> R {
    let Named { x, p, t, .. } = Named::new(inputs);
    p[3] - R::lit(0.3) * t - x[1].abs()
}

/// A formula that pulls back, harder from step to step.
fn pull<R: Real>(inputs: &[R]) -> Vec<R> {
    let Named { x, p, t, step, .. } = Named::new(inputs);
    vec![(R::lit(0.1) * step - p[4] * x[0]).clamp(R::lit(-1.0), R::lit(1.0)), t.cos() - x[2]]
}

/// Five numbers that a network sees.
fn observe<R: Real>(inputs: &[R]) -> Vec<R> {
    let Named { x, p, t, .. } = Named::new(inputs);
    vec![x[2].sin(), x[2].cos(), x[0] - p[4] * t.sin(), x[1], t.cos()]
}

/// The controls from three numbers that a network says.
fn act<R: Real>(inputs: &[R], said: &[R]) -> Vec<R> {
    let Named { x, p, step, .. } = Named::new(inputs);
    vec![p[1] * said[0] + R::lit(0.01) * step, said[1] - said[2] * x[1]]
}

/// Number of inputs of the drift's formulas: states, controls, parameters, time and step.
const INPUTS: usize = 3 + 2 + 5 + 2;

fn graph(formula: impl Fn(&[Expr]) -> Vec<Expr>) -> Graph {
    record(INPUTS, formula)
}

/// The drift, with these values of its parameters.
pub(crate) fn drift(values: [f32; 5]) -> Model {
    let mut model = Model::of(Outline);
    model.period = Some(PERIOD);
    model.step = graph(step);
    model.target = graph(|inputs| vec![target(inputs)]);
    model.constraint = graph(|inputs| vec![constraint(inputs)]);
    for (parameter, value) in model.parameters.iter_mut().zip(values) {
        parameter.value = value;
    }
    model
}

/// Values of the drift's parameters that differ from each other.
pub(crate) const VALUES: [f32; 5] = [0.3, 0.8, 1.1, 2.5, 0.4];

/// A network from `widths[0]` to `widths[last]` numbers with weights of both signs.
pub(crate) fn network(widths: &[usize]) -> Mlp {
    let mut state = 7_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let layer = |pair: &[usize]| {
        Layer::dense(
            (0..pair[0] * pair[1]).map(|_| uniform()).collect(),
            (0..pair[1]).map(|_| 0.2 * uniform()).collect(),
        )
    };
    let layers = widths.windows(2).map(layer).collect();
    Mlp::new(layers, Activation::Tanh, Activation::Tanh).expect("a whole network")
}

/// Who drives the drift in a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Driver {
    /// A formula of state, parameters, time and step.
    Formula,
    /// A network that sees the state and says the controls.
    Plain,
    /// A network with an observation and an action.
    Wrapped,
}

/// Every one of them.
pub(crate) const DRIVERS: [Driver; 3] = [Driver::Formula, Driver::Plain, Driver::Wrapped];

impl Driver {
    /// It as data.
    pub(crate) fn controller(self) -> Controller {
        let law = match self {
            Self::Formula => Law::Formula(graph(pull)),
            Self::Plain => {
                Law::Network { observe: None, network: Arc::new(network(&[3, 9, 2])), act: None }
            }
            Self::Wrapped => Law::Network {
                observe: Some(graph(observe)),
                network: Arc::new(network(&[5, 11, 3])),
                act: Some(record(INPUTS + 3, |inputs| act(&inputs[..INPUTS], &inputs[INPUTS..]))),
            },
        };
        Controller::new(format!("{self:?}"), law)
    }

    /// The drift driven by it.
    pub(crate) fn plant(self, values: [f32; 5]) -> Plant {
        Plant::new(drift(values), self.controller())
    }
}

/// The drift in f64.
pub(crate) struct Truth {
    driver: Driver,
    values: [f32; 5],
    networks: [Mlp; 2],
}

impl Truth {
    pub(crate) fn new(driver: Driver, values: [f32; 5]) -> Self {
        Self { driver, values, networks: [network(&[3, 9, 2]), network(&[5, 11, 3])] }
    }

    fn inputs(&self, x: &[f64], u: &[f64], step: u32) -> Vec<f64> {
        let values = self.values.iter().map(|value| f64::from(*value));
        let clock = [f64::from(step) * f64::from(PERIOD), f64::from(step)];
        x.iter().chain(u).copied().chain(values).chain(clock).collect()
    }

    fn control(&self, x: &[f64], step: u32) -> Vec<f64> {
        let inputs = self.inputs(x, &[f64::NAN; 2], step);
        match self.driver {
            Driver::Formula => pull(&inputs),
            Driver::Plain => self.networks[0].forward(x),
            Driver::Wrapped => act(&inputs, &self.networks[1].forward(&observe(&inputs))),
        }
    }

    fn next(&self, x: &[f64], u: &[f64], number: u32) -> Vec<f64> {
        step(&self.inputs(x, u, number))
    }

    /// Measures of a pair; the nominal one has tightened margins.
    pub(crate) fn pair(
        &self,
        [nominal, perturbed]: [&[f32]; 2],
        spec: &RolloutSpec,
        tightening: &Tightening,
        control: PairControl,
    ) -> [f64; 2] {
        let wide = |x: &[f32]| x.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
        let mut both = [wide(nominal), wide(perturbed)];
        let mut safe = [f64::INFINITY; 2];
        let mut best = [f64::NEG_INFINITY; 2];
        for number in 0..=spec.horizon {
            let discount = f64::from(spec.gamma).powi(number as i32);
            let at = number as usize;
            let lost = [f64::from(tightening.target[at]), f64::from(tightening.constraint[at])];
            for side in 0..2 {
                let inputs = self.inputs(&both[side], &[f64::NAN; 2], number);
                let [r, c] = if side == 0 { lost } else { [0.0; 2] };
                safe[side] = safe[side].min(discount * (constraint(&inputs) - c));
                best[side] = best[side].max(safe[side].min(discount * (target(&inputs) - r)));
            }
            let u = self.control(&both[0], number);
            let other = match control {
                PairControl::Replay => u.clone(),
                PairControl::ClosedLoop => self.control(&both[1], number),
            };
            both = [self.next(&both[0], &u, number), self.next(&both[1], &other, number)];
        }
        best
    }
}
