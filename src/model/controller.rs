//! The controller: what makes the controls of a model, as plain data.

use std::sync::Arc;

use crate::formula::Graph;
use crate::policy::Mlp;

/// A deterministic policy of a [`super::Model`].
#[derive(Clone, Debug, PartialEq)]
pub struct Controller {
    /// Short name for reports.
    pub name: String,
    /// How the controls come about; the model's step clips them.
    pub law: Law,
}

/// How controls come about.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// A formula with the inputs of the model (it uses no control), `[controls]`.
    Formula(Graph),
    /// A network with formulas around it.
    Network {
        /// The network's inputs, with the inputs of the model; without it, the states in order.
        observe: Option<Graph>,
        /// The network.
        network: Arc<Mlp>,
        /// The controls, with the inputs of the model followed by the network's outputs; without
        /// it, the outputs.
        act: Option<Graph>,
    },
}
