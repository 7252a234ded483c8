//! Coordinates that a region varies, and those that it freezes.

use crate::model::Model;

/// The coordinates of a region.
pub(super) struct Coordinates {
    /// Number of those that vary.
    pub(super) dimension: usize,
    /// Names of those that are frozen.
    pub(super) frozen: Vec<String>,
}

/// The coordinates of a region that varies those that `varies` says.
pub(super) fn coordinates(model: &Model, varies: &[bool]) -> Coordinates {
    let frozen = model.states.iter().zip(varies).filter(|(_, varies)| !**varies);
    let frozen: Vec<String> = frozen.map(|(axis, _)| axis.name.clone()).collect();
    Coordinates { dimension: model.states.len() - frozen.len(), frozen }
}
