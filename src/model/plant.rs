//! A model and who drives it: what rolls out, and its formulas one state at a time.

use std::sync::Arc;

use super::{Controller, Law, Model, Moment};
use crate::formula::{Graph, Node};
use crate::policy::{Mlp, Policy};
use crate::real::Real;
use crate::system::System;

/// A model and who drives it.
#[derive(Clone, Debug)]
pub struct Plant {
    /// The model.
    pub model: Arc<Model>,
    /// Who drives it.
    pub controller: Arc<Controller>,
}

impl Plant {
    /// A model and who drives it.
    pub fn new(model: Model, controller: Controller) -> Self {
        Self { model: Arc::new(model), controller: Arc::new(controller) }
    }

    /// The plant of a system and a policy that are written in Rust.
    ///
    /// ```
    /// use reachcast::model::Plant;
    /// use reachcast::system::{BangBang, DoubleIntegrator};
    /// let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    /// // At rest half a metre to the right, it accelerates to the left.
    /// let u = plant.control(&[0.5_f64, 0.0], 0);
    /// assert_eq!(plant.model.next(&[0.5, 0.0], &u, 0), [0.5, -f64::from(0.1_f32)]);
    /// ```
    pub fn of<S, P, const NX: usize, const NU: usize>(system: S, policy: P) -> Self
    where
        S: System<NX, NU> + Send + Sync + 'static,
        P: Policy<NX, NU> + Send + Sync + 'static,
    {
        let controller = Controller::of(&system, policy);
        Self::new(Model::of(system), controller)
    }

    /// A model under a network that sees its states in order and says its controls.
    pub fn under(model: &Arc<Model>, network: impl Into<Arc<Mlp>>) -> Self {
        let controller = Arc::new(Controller::network_alone(network));
        Self { model: Arc::clone(model), controller }
    }

    /// The controls at `x`, `[controls]`, at a step.
    pub fn control<R: Real>(&self, x: &[R], step: u32) -> Vec<R> {
        let zeros = || vec![R::lit(0.0); self.model.controls.len()];
        match &self.controller.law {
            Law::Formula(graph) => graph.eval(&self.model.arguments(x, &zeros(), step)),
            Law::Network { observe, network, act } => {
                let inputs = || self.model.arguments(x, &zeros(), step);
                let output = match observe {
                    Some(observe) => network.forward(&observe.eval(&inputs())),
                    None => network.forward(x),
                };
                match act {
                    Some(act) => act.eval(&[inputs(), output].concat()),
                    None => output,
                }
            }
        }
    }
}

impl Model {
    /// The inputs of the formulas.
    pub(crate) fn arguments<R: Real>(&self, x: &[R], u: &[R], at: impl Into<Moment>) -> Vec<R> {
        let at = at.into();
        // A step is a whole number below 2^24: exact.
        let [elapsed, step] = [at.elapsed(self.points), at.step as f32];
        self.arguments_at(x, u, [R::lit(elapsed), R::lit(step)])
    }

    /// The same where each lane may be at a time of its own: periods since the start, and the step.
    pub(crate) fn arguments_at<R: Real>(
        &self,
        x: &[R],
        u: &[R],
        [elapsed, step]: [R; 2],
    ) -> Vec<R> {
        let parameters = self.parameters.iter().map(|parameter| R::lit(parameter.value));
        let time = elapsed * R::lit(self.period.unwrap_or(0.0));
        x.iter().chain(u).copied().chain(parameters).chain([time, step]).collect()
    }

    /// Whether no formula of it reads the time: all steps are alike.
    pub fn is_stationary(&self) -> bool {
        // Time and step are the last two inputs.
        let first = self.inputs() as u32 - 2;
        let reads = |node: &Node| matches!(node, Node::Input(i) if *i >= first);
        [&self.step, &self.target, &self.constraint]
            .iter()
            .all(|graph| !graph.nodes.iter().any(reads))
    }

    /// The state a period after `x` under the control `u`, `[states]`.
    pub fn next<R: Real>(&self, x: &[R], u: &[R], step: u32) -> Vec<R> {
        self.parts(x, u, step).pop().unwrap_or_else(|| x.to_vec())
    }

    /// The target margin at `x`: positive inside the target set.
    pub fn target_at<R: Real>(&self, x: &[R], at: impl Into<Moment>) -> R {
        self.margin(&self.target, x, at.into())
    }

    /// The constraint margin at `x`: positive where safe.
    pub fn constraint_at<R: Real>(&self, x: &[R], at: impl Into<Moment>) -> R {
        self.margin(&self.constraint, x, at.into())
    }

    fn margin<R: Real>(&self, margin: &Graph, x: &[R], at: Moment) -> R {
        margin.eval_first(&self.at_state(x, at), &mut Vec::with_capacity(margin.nodes.len()))
    }

    /// The inputs of the formulas at a state, where no formula reads a control.
    pub(crate) fn at_state<R: Real>(&self, x: &[R], at: impl Into<Moment>) -> Vec<R> {
        self.arguments(x, &vec![R::lit(0.0); self.controls.len()], at)
    }
}
