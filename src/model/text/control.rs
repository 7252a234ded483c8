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
use crate::model::controller::{Controller, Law, picked};
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
        let missing =
            || self.origin.refuse("policy", "no policy; expected `file`, a network, or `formula`");
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
        let observe = match policy.observe.as_deref() {
            Some(formulas) => Some(self.recorded("policy.observe", formulas, &networks)?),
            None => self.places(policy, &network)?.map(|places| picked(self.inputs(), &places)),
        };
        let (name, outputs) = (network.in_words(), outputs(&network));
        let act = policy.act.as_deref().map(|formulas| self.act(formulas, outputs, &networks));
        let law = Law::Network { observe, network: Arc::new(network), act: act.transpose()? };
        Ok(Controller::new(name, law))
    }

    /// Refuses a network that does not take what it would be given.
    fn check_inputs(&self, policy: &NetworkPolicy, network: &Mlp) -> Result<()> {
        let Some(observe) = &policy.observe else {
            return self.places(policy, network).map(|_| ());
        };
        let (inputs, given) = (network.widths()[0], observe.len());
        if given != inputs {
            let problem = format!(
                "the network takes {inputs} inputs, the model has {given} formulas in `observe`"
            );
            return Err(self.refuse_file(&policy.file, &problem));
        }
        Ok(())
    }

    /// The places of the network's inputs among the states, where it names a part of them or another order.
    fn places(&self, policy: &NetworkPolicy, network: &Mlp) -> Result<Option<Vec<usize>>> {
        let states: Vec<&str> = self.states.iter().map(|state| state.axis.name.as_str()).collect();
        let named = |problem: String| format!("{problem}; `observe` gives a network other inputs");
        let places = network.places_among(&states).map_err(named);
        places.map_err(|problem| self.refuse_file(&policy.file, &problem))
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
