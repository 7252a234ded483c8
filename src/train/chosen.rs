//! A plant whose first controls are given with its start, what Q(x, u) is the measure of.

use crate::formula::{Expr, Graph, record};
use crate::model::{Controller, Law, Model, Plant};
use crate::policy::Mlp;
use crate::real::Real;
use crate::system::Axis;

/// The plant that takes the last numbers of its start as the controls of the first step, and those of `plant`'s
/// controller from then on: they are further states of it, which stay as they are.
pub fn chosen_first(plant: &Plant) -> Plant {
    let chosen = Chosen { model: &plant.model };
    Plant::new(chosen.model(), chosen.controller(&plant.controller))
}

/// Formulas of a model, and of the same with its first controls as further states.
struct Chosen<'a> {
    model: &'a Model,
}

impl Chosen<'_> {
    /// The controls that were chosen, among the inputs of the model with them.
    fn controls<'i>(&self, inputs: &'i [Expr]) -> &'i [Expr] {
        &inputs[self.model.states.len()..][..self.model.controls.len()]
    }

    /// The inputs of the model without them, and whatever follows.
    fn without(&self, inputs: &[Expr]) -> Vec<Expr> {
        let (states, rest) = inputs.split_at(self.model.states.len());
        [states, &rest[self.model.controls.len()..]].concat()
    }

    /// What `of` makes of the inputs of the model with them, and of `more` behind these.
    fn record(&self, more: usize, of: impl Fn(&[Expr]) -> Vec<Expr>) -> Graph {
        record(self.model.inputs() + self.model.controls.len() + more, of)
    }

    /// `graph`, which does not see them.
    fn of(&self, graph: &Graph) -> Graph {
        self.record(0, |inputs| graph.recorded_at(&self.without(inputs)))
    }

    fn model(&self) -> Model {
        let model = self.model;
        let step = self.record(0, |inputs| {
            let next = model.step.recorded_at(&self.without(inputs));
            [&next[..], self.controls(inputs)].concat()
        });
        let named = |axis: &Axis| Axis { name: format!("first {}", axis.name), ..axis.clone() };
        Model {
            states: model.states.iter().cloned().chain(model.controls.iter().map(named)).collect(),
            step,
            target: self.of(&model.target),
            constraint: self.of(&model.constraint),
            native: None,
            ..model.clone()
        }
    }

    /// The chosen controls at the first step, `driven` at the others.
    fn choice(&self, inputs: &[Expr], driven: &[Expr]) -> Vec<Expr> {
        let step = inputs[self.model.inputs() + self.model.controls.len() - 1];
        let either =
            |(chosen, driven): (&Expr, &Expr)| step.if_lt(Expr::lit(0.5), *chosen, *driven);
        self.controls(inputs).iter().zip(driven).map(either).collect()
    }

    fn controller(&self, controller: &Controller) -> Controller {
        let law = match &controller.law {
            Law::Formula(graph) => Law::Formula(self.record(0, |inputs| {
                self.choice(inputs, &graph.recorded_at(&self.without(inputs)))
            })),
            Law::Network { observe, network, act } => Law::Network {
                observe: Some(self.record(0, |inputs| match observe {
                    Some(observe) => observe.recorded_at(&self.without(inputs)),
                    None => inputs[..self.model.states.len()].to_vec(),
                })),
                network: network.clone(),
                act: Some(self.record(self.outputs(network), |inputs| match act {
                    Some(act) => self.choice(inputs, &act.recorded_at(&self.without(inputs))),
                    None => self.choice(inputs, &inputs[inputs.len() - self.outputs(network)..]),
                })),
            },
        };
        Controller::new(controller.name.clone(), law)
    }

    /// How many numbers `network` says.
    fn outputs(&self, network: &Mlp) -> usize {
        network.widths().last().copied().unwrap_or(0)
    }
}
