//! From a description to a model: margins, and the step with its clipped controls and its rule of
//! integration, recorded over the inputs of the model.

use super::description::Description;
use super::disturbances::Disturbance;
use super::dynamics::{Dynamics, Integration, Integrator};
use super::written::Written;
use crate::error::Result;
use crate::formula::text::{MOST_NODES, Networks, Values};
use crate::formula::{Graph, Scalar, record};
use crate::model::{Model, Picture};
use crate::real::Real;
use crate::system::Axis;

/// Key of what makes a step of formulas that are small enough too large.
const SUBSTEPS: &str = "model.time.substeps";

/// The target margin of a task without a target.
const NOWHERE: f32 = -1.0;
/// The constraint margin of a task without a constraint.
const EVERYWHERE: f32 = 1.0;

/// Formulas of a description with the intermediate ones that they need.
struct Formulas<'a> {
    description: &'a Description,
    formulas: &'a [Written],
    needed: Vec<bool>,
    networks: &'a Networks,
}

impl Description {
    /// The model: its formulas recorded over states, controls, parameters, time and step. Values of
    /// parameters are data of the model and no part of a graph.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the formulas whose graph is too large, or the call of a network
    /// that cannot be read or does not fit.
    pub fn model(&self) -> Result<Model> {
        let networks = self.table()?;
        let margin = |written: &Option<Written>, absent: f32| match written {
            Some(written) => self.recorded(&written.key, std::slice::from_ref(written), &networks),
            None => Ok(record(self.inputs(), |_| vec![Real::lit(absent)])),
        };
        Ok(Model {
            name: self.name.clone(),
            states: self.states.iter().map(|state| state.axis.clone()).collect(),
            controls: self.controls.clone(),
            parameters: self.parameters.clone(),
            period: self.period,
            points: self.task.between + 1,
            step: self.step(&networks, &[])?,
            task: self.task.task,
            target: margin(&self.task.target, NOWHERE)?,
            constraint: margin(&self.task.constraint, EVERYWHERE)?,
            bodies: self.bodies.at_states.clone(),
            picture: Picture {
                bodies: self.placed_bodies(&networks)?,
                shapes: self.shapes.clone(),
            },
            smallest_feature: None,
            native: None,
        })
    }

    /// Inputs of each formula: states, controls, parameters, time and step.
    pub(super) fn inputs(&self) -> usize {
        self.time() + 2
    }

    /// The input that is the time in seconds.
    fn time(&self) -> usize {
        self.states.len() + self.controls.len() + self.parameters.len()
    }

    /// The graph of `formulas`, which stand at the dotted key `path`.
    pub(super) fn recorded(
        &self,
        path: &str,
        formulas: &[Written],
        networks: &Networks,
    ) -> Result<Graph> {
        let formulas = Formulas::new(self, formulas, networks);
        self.check_size(path, formulas.operations())?;
        let graph = record(self.inputs(), |inputs| formulas.values(inputs));
        self.check_size(path, graph.nodes.len())?;
        Ok(graph)
    }

    /// Refuses a graph of `nodes` nodes if that is too many.
    pub(super) fn check_size(&self, path: &str, nodes: usize) -> Result<()> {
        if nodes > MOST_NODES {
            let problem = format!("{nodes} operations in all, at most {MOST_NODES} are allowed");
            return Err(self.origin.refuse(path, problem));
        }
        Ok(())
    }

    /// The graph of the state after one part of a period, the next one where nothing is looked at between, of
    /// the inputs of the model and one for each of the disturbances that `act`, as a share of its bound.
    pub(super) fn step(&self, networks: &Networks, act: &[Disturbance]) -> Result<Graph> {
        let (path, formulas, stages) = match &self.dynamics {
            Dynamics::Next(formulas) => ("model.next", formulas, 1),
            Dynamics::Flow(formulas, rule) => ("model.flow", formulas, rule.stages()),
        };
        let formulas = Formulas::new(self, formulas, networks);
        // Counted before anything is recorded: millions of substeps would fill the memory.
        let once = formulas.operations() + formulas.formulas.len();
        self.check_size(path, once.saturating_mul(stages / self.substeps()))?;
        self.check_size(SUBSTEPS, once.saturating_mul(stages))?;
        let graph = record(self.inputs() + act.len(), |inputs| {
            let mut inputs = self.clipped(inputs);
            for (share, disturbance) in inputs[self.inputs()..].iter_mut().zip(act) {
                *share = *share * Real::lit(disturbance.bound);
            }
            match &self.dynamics {
                Dynamics::Next(_) => formulas.values(&inputs),
                Dynamics::Flow(_, rule) => {
                    let substeps = rule.substeps / (self.task.between + 1);
                    formulas.integrated(&inputs, *rule, substeps)
                }
            }
        });
        self.check_size(path, graph.nodes.len())?;
        Ok(graph)
    }

    /// Substeps of a step, 1 where it is not integrated.
    fn substeps(&self) -> usize {
        match &self.dynamics {
            Dynamics::Next(_) => 1,
            Dynamics::Flow(_, rule) => (rule.substeps as usize).max(1),
        }
    }

    /// The inputs with every control within its bounds.
    fn clipped<R: Real>(&self, inputs: &[R]) -> Vec<R> {
        let mut inputs = inputs.to_vec();
        for (u, axis) in inputs[self.states.len()..].iter_mut().zip(&self.controls) {
            *u = clip(*u, axis);
        }
        inputs
    }
}

/// `u` within the bounds of `axis`, of which an infinite one leaves its side open.
fn clip<R: Real>(u: R, axis: &Axis) -> R {
    let (low, high) = (axis.low, axis.high);
    match (low.is_finite(), high.is_finite()) {
        (true, true) => u.clamp(R::lit(low), R::lit(high)),
        // Not the larger of two, which would not hand on a NaN.
        (true, false) => u.if_lt(R::lit(low), R::lit(low), u),
        (false, true) => R::lit(high).if_lt(u, R::lit(high), u),
        (false, false) => u,
    }
}

impl Integration {
    /// How often the derivatives are evaluated in a step.
    fn stages(self) -> usize {
        let each = match self.integrator {
            Integrator::Euler => 1,
            Integrator::Rk4 => 4,
        };
        each * self.substeps as usize
    }

    /// Seconds of a substep.
    fn seconds(self) -> f64 {
        f64::from(self.period) / f64::from(self.substeps)
    }
}

impl<'a> Formulas<'a> {
    fn new(description: &'a Description, formulas: &'a [Written], networks: &'a Networks) -> Self {
        Self { description, formulas, needed: description.lets.needed(formulas), networks }
    }

    /// Operations of one evaluation.
    fn operations(&self) -> usize {
        let own = self.formulas.iter().map(|written| written.formula.operations());
        own.sum::<usize>() + self.description.lets.operations(&self.needed)
    }

    /// Their values at `inputs`.
    fn values<R: Scalar>(&self, inputs: &[R]) -> Vec<R> {
        let names = self.names(inputs);
        self.formulas.iter().map(|written| self.value(written, &names)).collect()
    }

    /// The values of all names at `inputs`.
    fn names<R: Scalar>(&self, inputs: &[R]) -> Vec<R> {
        self.description.lets.values(inputs, &self.needed, self.networks)
    }

    /// The value of `written` for the values of all names.
    fn value<R: Scalar>(&self, written: &Written, names: &[R]) -> R {
        written.formula.value(Values { names, outputs: &[], looked: &[], networks: self.networks })
    }

    /// The state `substeps` substeps after `inputs`, the formulas being derivatives.
    fn integrated<R: Scalar>(&self, inputs: &[R], rule: Integration, substeps: u32) -> Vec<R> {
        let count = self.description.states.len();
        let mut moment = inputs.to_vec();
        for substep in 0..substeps {
            let begin = f64::from(substep) * rule.seconds();
            self.at_time(&mut moment, inputs, begin);
            let next = match rule.integrator {
                Integrator::Euler => self.euler(&moment, rule.seconds()),
                Integrator::Rk4 => self.rk4(&moment, inputs, begin, rule.seconds()),
            };
            moment[..count].copy_from_slice(&next);
        }
        moment.truncate(count);
        moment
    }

    /// Sets the time of `moment` to `after` seconds after the beginning of the step.
    fn at_time<R: Real>(&self, moment: &mut [R], inputs: &[R], after: f64) {
        let time = self.description.time();
        let after = after as f32;
        moment[time] = if after == 0.0 { inputs[time] } else { inputs[time] + R::lit(after) };
    }

    /// `x + h f(x, t)`.
    fn euler<R: Scalar>(&self, moment: &[R], seconds: f64) -> Vec<R> {
        let h = R::lit(seconds as f32);
        let names = self.names(moment);
        let next = |(x, written): (&R, &Written)| *x + h * self.value(written, &names);
        moment.iter().zip(self.formulas).map(next).collect()
    }

    /// `x + h / 6 (k1 + 2 k2 + 2 k3 + k4)`, with the slopes at the beginning, twice in the middle,
    /// and at the end of the substep that begins `begin` seconds after `inputs`.
    fn rk4<R: Scalar>(&self, moment: &[R], inputs: &[R], begin: f64, seconds: f64) -> Vec<R> {
        let slope = |from: &[R], after: f64, slopes: &[R]| {
            let mut there = moment.to_vec();
            self.at_time(&mut there, inputs, begin + after);
            let h = R::lit(after as f32);
            let moved = from.iter().zip(slopes).map(|(x, k)| *x + h * *k);
            for (x, moved) in there.iter_mut().zip(moved) {
                *x = moved;
            }
            self.values(&there)
        };
        let half = 0.5 * seconds;
        let first = self.values(moment);
        let second = slope(moment, half, &first);
        let third = slope(moment, half, &second);
        let last = slope(moment, seconds, &third);
        let (sixth, two) = (R::lit((seconds / 6.0) as f32), R::lit(2.0));
        let mean = |i: usize| (first[i] + last[i]) + two * (second[i] + third[i]);
        (0..first.len()).map(|i| moment[i] + sixth * mean(i)).collect()
    }
}
