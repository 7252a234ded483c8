//! Maps that a formula of costs asks: which ones, and where.

use std::sync::Arc;

use crate::cost::CostMap;
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
}
