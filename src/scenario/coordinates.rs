//! Coordinates that a region varies, and those that it freezes.

use crate::model::Model;

/// Names and number of the coordinates that vary and of those that are frozen.
pub(super) fn coordinates(model: &Model, varies: &[bool]) -> (usize, Vec<String>) {
    let frozen = model.states.iter().zip(varies).filter(|(_, varies)| !**varies);
    let frozen: Vec<String> = frozen.map(|(axis, _)| axis.name.clone()).collect();
    (model.states.len() - frozen.len(), frozen)
}
