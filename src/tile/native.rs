//! What a tile asks of a plant: called once per tile, not once per trajectory.

use std::fmt::Debug;

use super::Frame;
use crate::real::simd::Instructions;

/// A system whose formulas are evaluated for the first `lanes` trajectories of a tile.
pub(crate) trait NativeSystem: Debug + Send + Sync {
    /// Moves the states one step on, by the controls.
    fn step(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// Evaluates both margins.
    fn margins(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// Widest layer of the networks that the formulas call; `None` if they call none.
    fn widest(&self) -> Option<usize> {
        None
    }
}

/// A formula from rows of a tile to rows of it: a policy, or what stands around a network.
pub(crate) trait NativeFormula: Debug + Send + Sync {
    /// Evaluates it for the first `lanes` trajectories.
    fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// Widest layer of the networks that it calls; `None` if it calls none.
    fn widest(&self) -> Option<usize> {
        None
    }
}
