//! From a description to a controller: its formulas recorded, its network read.

use std::path::Path;
use std::sync::Arc;

use super::description::Description;
use super::policy::{NetworkPolicy, Policy};
use super::written::Written;
use crate::error::{Error, Result};
use crate::formula::text::{Networks, Values};
use crate::formula::{Graph, record};
use crate::model::Plant;
use crate::model::controller::{Controller, Law};
use crate::policy::Mlp;

impl Description {
    /// The model and its policy.
    ///
    /// # Errors
    /// Those of [`Description::model`] and [`Description::controller`].
    pub fn plant(&self) -> Result<Plant> {
        Ok(Plant::new(self.model()?, self.controller()?))
    }

    /// The policy: its formulas recorded over the inputs of the model, its network read.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no policy, a formula is too large or asks for an output that
    /// the network does not have, or calls a network that cannot be read or does not fit, or if the
    /// policy's network cannot be read or has another width.
    pub fn controller(&self) -> Result<Controller> {
        let missing = || {
            self.origin
                .refuse("policy", "missing: no policy; expected `file`, a network, or `formula`")
        };
        match self.policy.as_ref().ok_or_else(missing)? {
            Policy::Formulas(formulas) => {
                let networks = self.table()?;
                let law = Law::Formula(self.recorded("policy.formula", formulas, &networks)?);
                Ok(Controller::new("formula", law))
            }
            Policy::Network(policy) => {
                let network = Mlp::load(&policy.file).map_err(|error| match error {
                    Error::File { problem, .. } => self.refuse_file(&policy.file, &problem),
                    other => other,
                })?;
                self.network(policy, network)
            }
        }
    }

    /// The policy around a `network` that was read before.
    ///
    /// # Errors
    /// Those of [`Description::controller`]; [`Error::Invalid`] for a policy that is no network.
    pub fn controller_of(&self, network: Mlp) -> Result<Controller> {
        match &self.policy {
            Some(Policy::Network(policy)) => self.network(policy, network),
            _ => Err(self.origin.refuse("policy", "no network; expected `file`")),
        }
    }

    /// The refusal of the network in `file`, at the key that names it.
    fn refuse_file(&self, file: &Path, problem: &str) -> Error {
        self.origin.refuse("policy.file", format!("{}: {problem}", file.display()))
    }

    fn network(&self, policy: &NetworkPolicy, network: Mlp) -> Result<Controller> {
        self.check_inputs(policy, &network)?;
        self.check_outputs(policy, &network)?;
        let networks = self.table()?;
        let observe = policy.observe.as_deref();
        let observe = observe.map(|formulas| self.recorded("policy.observe", formulas, &networks));
        let (name, outputs) = (network.in_words(), outputs(&network));
        let act = policy.act.as_deref().map(|formulas| self.act(formulas, outputs, &networks));
        let law = Law::Network {
            observe: observe.transpose()?,
            network: Arc::new(network),
            act: act.transpose()?,
        };
        Ok(Controller::new(name, law))
    }

    /// Refuses a network that does not take what it would be given.
    fn check_inputs(&self, policy: &NetworkPolicy, network: &Mlp) -> Result<()> {
        let inputs = network.widths()[0];
        let (given, what) = match &policy.observe {
            Some(observe) => (observe.len(), "formulas in `observe`"),
            None => (self.states.len(), "states; `observe` gives a network other inputs"),
        };
        if given != inputs {
            let problem =
                format!("the network takes {inputs} inputs, the model has {given} {what}");
            return Err(self.refuse_file(&policy.file, &problem));
        }
        match network.state_order() {
            Some(order) if policy.observe.is_none() => self.check_order(&policy.file, order),
            _ => Ok(()),
        }
    }

    /// Refuses a network whose inputs have other names than the states.
    fn check_order(&self, file: &Path, order: &[String]) -> Result<()> {
        let states: Vec<&str> = self.states.iter().map(|state| state.axis.name.as_str()).collect();
        if order.iter().eq(&states) {
            return Ok(());
        }
        let problem = format!(
            "its inputs are `{}`, the states of the model are `{}`; `observe` gives a network its \
             inputs by name",
            order.join(","),
            states.join(",")
        );
        Err(self.refuse_file(file, &problem))
    }

    /// Refuses a network that does not give what is asked for.
    fn check_outputs(&self, policy: &NetworkPolicy, network: &Mlp) -> Result<()> {
        let outputs = outputs(network);
        let Some(act) = &policy.act else {
            let controls = self.controls.len();
            if outputs == controls {
                return Ok(());
            }
            let problem = format!(
                "the network has {outputs} outputs, the model has {controls} controls; `act` makes \
                 controls of other outputs"
            );
            return Err(self.refuse_file(&policy.file, &problem));
        };
        for written in act {
            let beyond = written.formula.outputs().find(|out| out.number as usize >= outputs);
            if let Some(found) = beyond {
                let problem = format!(
                    "`out[{}]` is none of the network's outputs, 0 to {}",
                    found.number,
                    outputs - 1
                );
                return Err(written.refuse(&self.origin, found.at, problem));
            }
        }
        Ok(())
    }

    /// The controls over the inputs of the model and the `outputs` of the network behind them.
    pub(super) fn act(
        &self,
        formulas: &[Written],
        outputs: usize,
        networks: &Networks,
    ) -> Result<Graph> {
        let needed = self.lets.needed(formulas);
        let own: usize = formulas.iter().map(|written| written.formula.operations()).sum();
        self.check_size("policy.act", own + self.lets.operations(&needed))?;
        let graph = record(self.inputs() + outputs, |inputs| {
            let (inputs, outputs) = inputs.split_at(self.inputs());
            let names = self.lets.values(inputs, &needed, networks);
            let values = Values { names: &names, outputs, looked: &[], networks };
            formulas.iter().map(|written| written.formula.value(values)).collect()
        });
        self.check_size("policy.act", graph.nodes.len())?;
        Ok(graph)
    }
}

/// The number of outputs of `network`.
fn outputs(network: &Mlp) -> usize {
    network.widths().last().copied().unwrap_or_default()
}
