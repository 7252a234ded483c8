//! Whether the formulas of a plant are of its model: asked once, before it is prepared.

use super::{Law, Plant};
use crate::error::{Error, Result};
use crate::formula::Graph;

/// A formula by its name, with the inputs and outputs that it has to have.
struct Part<'a> {
    name: &'static str,
    graph: &'a Graph,
    inputs: usize,
    /// Any number where nothing is said.
    outputs: Option<usize>,
}

impl Part<'_> {
    fn check(&self) -> Result<()> {
        let (has, gives) = (self.graph.inputs, self.graph.outputs.len());
        let outputs = self.outputs.unwrap_or(gives);
        if (has, gives) == (self.inputs, outputs) {
            return Ok(());
        }
        let problem = format!(
            "the formula takes {has} inputs and gives {gives} numbers; {} and {outputs} are needed, \
             the inputs being states, controls, parameters, time and step",
            self.inputs
        );
        Err(Error::invalid(self.name, problem))
    }
}

impl Plant {
    /// Refuses a model without states, and formulas that take other inputs than the model has, or give
    /// another count of numbers than asked for. The network has a check of its own.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the formula, with both counts.
    pub(crate) fn check(&self) -> Result<()> {
        let model = &self.model;
        let (inputs, states) = (model.inputs(), model.states.len());
        if states == 0 {
            return Err(Error::invalid("model.states", "none given; a model has one at least"));
        }
        if model.points == 0 {
            return Err(Error::invalid("model.points", "0 parts of a period; 1 is the least"));
        }
        let part = |name, graph, outputs| Part { name, graph, inputs, outputs: Some(outputs) };
        part("model.step", &model.step, states).check()?;
        part("model.target", &model.target, 1).check()?;
        part("model.constraint", &model.constraint, 1).check()?;
        let controls = model.controls.len();
        match &self.controller.law {
            Law::Formula(graph) => part("policy", graph, controls).check(),
            Law::Network { observe, network, act } => {
                let said = network.widths().last().copied().unwrap_or(0);
                let observe = observe
                    .iter()
                    .map(|graph| Part { outputs: None, ..part("policy.observe", graph, 0) });
                let act = act.iter().map(|graph| Part {
                    inputs: inputs + said,
                    ..part("policy.act", graph, controls)
                });
                observe.chain(act).try_for_each(|part| part.check())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::formula::record;
    use crate::model::{Controller, Model};
    use crate::policy::{Activation, Layer, Mlp};
    use crate::system::{BangBang, DoubleIntegrator};

    fn refusal(model: Model, law: Law) -> String {
        Plant::new(model, Controller::new("law", law)).check().expect_err("refused").to_string()
    }

    #[test]
    fn formulas_of_other_models_are_refused() {
        let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
        plant.check().expect("a plant");
        let model = Model::of(DoubleIntegrator::default());
        let inputs = model.inputs();
        let sums = |inputs, outputs| record(inputs, |x| vec![x[0] + x[1]; outputs]);
        let needed =
            |more: usize, outputs: usize| format!("{} and {outputs} are needed", inputs + more);
        let of = |found: String, words: [&str; 2]| {
            words.iter().for_each(|word| assert!(found.contains(word), "no `{word}` in: {found}"));
        };
        of(refusal(model.clone(), Law::Formula(sums(2, 1))), ["policy: ", "takes 2 inputs"]);
        of(
            refusal(model.clone(), Law::Formula(sums(inputs, 3))),
            ["gives 3 numbers", &needed(0, 1)],
        );
        let step = Model { step: sums(inputs, 1), ..model.clone() };
        of(refusal(step, Law::Formula(sums(inputs, 1))), ["model.step", &needed(0, 2)]);
        let target = Model { target: sums(inputs, 2), ..model.clone() };
        of(refusal(target, Law::Formula(sums(inputs, 1))), ["model.target", "gives 2 numbers"]);
        let layer = Layer::dense(vec![1.0; 4], vec![0.0; 2]);
        let network = Mlp::new(vec![layer], Activation::Relu, Activation::Identity);
        let network = Arc::new(network.expect("a network"));
        let around = |observe, act| Law::Network { observe, network: Arc::clone(&network), act };
        let act = Some(sums(inputs, 1));
        of(refusal(model.clone(), around(None, act)), ["policy.act", &needed(2, 1)]);
        let observe = Some(sums(inputs + 1, 2));
        of(refusal(model, around(observe, None)), ["policy.observe", &needed(0, 2)]);
    }
}
