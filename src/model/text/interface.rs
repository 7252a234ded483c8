//! The formulas around a network that is not there yet, and the dynamics under a disturbance.

use super::description::Description;
use super::policy::{NetworkPolicy, Policy};
use crate::error::Result;
use crate::formula::Graph;
use crate::model::Interface;

impl Description {
    /// What stands around the network of the policy, whose file is not read: as many outputs as `act` asks
    /// for, a control each where there is none.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a policy that is no network, a formula that is too large, or one that
    /// calls a network that cannot be read or does not fit.
    pub fn interface(&self) -> Result<Interface> {
        let Some(Policy::Network(policy)) = &self.policy else {
            return Err(self.origin.refuse("policy", "no network; expected `file`"));
        };
        let networks = self.table()?;
        let observe = policy.observe.as_deref();
        let observe = observe.map(|formulas| self.recorded("policy.observe", formulas, &networks));
        let outputs = self.asked_outputs(policy);
        let act = policy.act.as_deref().map(|formulas| self.act(formulas, outputs, &networks));
        Ok(Interface { observe: observe.transpose()?, act: act.transpose()?, outputs })
    }

    /// Outputs of a network that has as many as are asked for, and at least one.
    fn asked_outputs(&self, policy: &NetworkPolicy) -> usize {
        let Some(act) = &policy.act else { return self.controls.len() };
        let asked = act.iter().flat_map(|written| written.formula.outputs());
        asked.map(|out| out.number as usize + 1).max().unwrap_or(1)
    }

    /// The next state where disturbances act: of the inputs of the model, followed by a number from -1 to 1
    /// for each disturbance, which its bound is multiplied with.
    ///
    /// # Errors
    /// Those of [`Description::model`].
    pub fn disturbed_step(&self) -> Result<Graph> {
        self.step(&self.table()?, &self.disturbances)
    }
}
