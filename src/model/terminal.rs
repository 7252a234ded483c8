//! What the end of a plan costs, as data.

use super::Model;
use super::lookups::Lookups;
use crate::error::{Error, Result};
use crate::formula::{Graph, Node};

/// What the state after the last control of a plan costs: added once to each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct TerminalCost {
    /// The cost, a single output; lower is better. Its inputs are those of the model, then the contexts
    /// of a row of their own behind the stages', then what the maps say. It reads no control: there is
    /// none at this state.
    pub formula: Graph,
    /// The maps that it asks.
    pub lookups: Option<Lookups>,
}

impl TerminalCost {
    /// A cost that asks no map.
    pub fn new(formula: Graph) -> Self {
        Self { formula, lookups: None }
    }

    /// Refuses a formula that reads a control of `model`.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the name of the control.
    pub(super) fn check(&self, model: &Model) -> Result<()> {
        let cells = self.lookups.iter().map(|lookups| &lookups.cells);
        for graph in cells.chain([&self.formula]) {
            let read =
                |i: &usize| graph.nodes.contains(&Node::Input((model.states.len() + i) as u32));
            if let Some(control) = (0..model.controls.len()).find(read) {
                let name = &model.controls[control].name;
                let text = format!(
                    "the terminal cost reads the control `{name}`; it is of the state after the last one"
                );
                return Err(Error::invalid("cost", text));
            }
        }
        Ok(())
    }
}
