//! Maps that a formula of costs asks: which ones, and where.

use std::sync::Arc;

use crate::cost::CostMap;
use crate::error::{Error, Result};
use crate::formula::Graph;

/// Maps that a formula of costs asks. What they say is one more input of the formula for each, behind
/// the contexts.
#[derive(Clone, Debug, PartialEq)]
pub struct Lookups {
    /// The map of each, `[lookups]`.
    pub maps: Vec<Arc<CostMap>>,
    /// The number of the cell of each, [`CostMap::cell`] of the place, `[lookups]`; of the inputs of the
    /// model and the contexts behind them.
    pub cells: Graph,
}

impl Lookups {
    /// What the maps say at `inputs`, those of the model and the contexts, `[lookups]`; NaN where a
    /// place is no number.
    pub fn values(&self, inputs: &[f32]) -> Vec<f32> {
        let cells = self.cells.eval(inputs);
        self.maps.iter().zip(cells).map(|(map, cell)| map.at_cell(cell)).collect()
    }

    /// Refuses places that are not of `inputs` inputs, one for each map, and lookups of no map.
    ///
    /// # Errors
    /// [`Error::Invalid`] with both numbers.
    pub(super) fn check(&self, inputs: usize) -> Result<()> {
        if self.maps.is_empty() {
            return Err(Error::invalid("cost", "lookups of no map; leave them out"));
        }
        fits("place on the maps", &self.cells, [inputs, self.maps.len()])
    }
}

/// Refuses a formula of other than `[inputs, outputs]`.
pub(super) fn fits(name: &str, graph: &Graph, [inputs, outputs]: [usize; 2]) -> Result<()> {
    let has = [graph.inputs, graph.outputs.len()];
    if has == [inputs, outputs] {
        return Ok(());
    }
    let text = format!(
        "the {name} takes {} inputs and gives {} numbers; {inputs} and {outputs} are needed",
        has[0], has[1]
    );
    Err(Error::invalid("cost", text))
}
