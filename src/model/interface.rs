//! What stands between a network and the model that it drives: what it sees, and what comes of what it says.

use std::sync::Arc;

use super::{Controller, Law, Model, Plant};
use crate::formula::{Graph, Node};
use crate::policy::Mlp;

/// What a network sees of a model, and the controls that its outputs are.
#[derive(Clone, Debug, PartialEq)]
pub struct Interface {
    /// What it sees, of the inputs of the model; the states in order if nothing is said.
    pub observe: Option<Graph>,
    /// The controls, of the inputs of the model followed by the outputs; those themselves, in order, if
    /// nothing is said.
    pub act: Option<Graph>,
    /// Number of outputs.
    pub outputs: usize,
}

impl Interface {
    /// A network that sees the states of `model` in order and says its controls.
    pub fn plain(model: &Model) -> Self {
        Self { observe: None, act: None, outputs: model.controls.len() }
    }

    /// `network` between these formulas.
    pub fn controller(&self, network: impl Into<Arc<Mlp>>) -> Controller {
        let network = network.into();
        let Self { observe, act, .. } = self.clone();
        Controller::new(network.in_words(), Law::Network { observe, network, act })
    }

    /// `model` under `network` between these formulas.
    pub fn plant(&self, model: &Arc<Model>, network: impl Into<Arc<Mlp>>) -> Plant {
        let controller = Arc::new(self.controller(network));
        Plant { model: Arc::clone(model), controller }
    }

    /// The interval of each input of the network where states have the intervals `states`: those of the
    /// states, and -1 to 1 for a formula, which is taken to be scaled as it is written.
    pub fn intervals(&self, states: &[[f32; 2]]) -> Vec<[f32; 2]> {
        match &self.observe {
            Some(observe) => vec![[-1.0, 1.0]; observe.outputs.len()],
            None => states.to_vec(),
        }
    }

    /// Names of the inputs of the network: of the states of `model`, where it sees these.
    pub fn order(&self, model: &Model) -> Option<Vec<String>> {
        let names = || model.states.iter().map(|axis| axis.name.clone()).collect();
        self.observe.is_none().then(names)
    }

    /// Whether no formula of it reads the time, whose place among the inputs `model` knows.
    pub fn is_stationary(&self, model: &Model) -> bool {
        let times = model.inputs() as u32 - 2..model.inputs() as u32;
        let reads = |node: &Node| matches!(node, Node::Input(i) if times.contains(i));
        let mut graphs = self.observe.iter().chain(&self.act);
        graphs.all(|graph| !graph.nodes.iter().any(reads))
    }
}
