//! What a tile asks of a plant: called once per tile, not once per trajectory.

use std::ops::Range;

use super::dispatch::Instructions;
use super::frame::Frame;

/// A plant whose formulas are evaluated for the first `lanes` trajectories of a tile, with the
/// instructions of the caller.
pub(super) trait Physics: Sync {
    /// Number of states and of controls.
    fn size(&self) -> [usize; 2];

    /// Rows of its own that it needs in a frame.
    fn own_rows(&self) -> usize {
        0
    }

    /// Fills rows of its own that stay as they are.
    fn fill(&self, _frame: &mut Frame) {}

    /// Whether formulas read the row of steps.
    fn timed(&self) -> bool {
        false
    }

    /// Evaluates the policy's formula, to the rows of the controls.
    fn control(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// Moves the states one step on, by the controls.
    fn step(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// Evaluates both margins.
    fn margins(&self, with: Instructions, frame: &mut Frame, lanes: usize);

    /// What a network that drives the plant reads and says.
    fn network_size(&self) -> [usize; 2] {
        self.size()
    }

    /// The rows that a network reads, once [`Physics::observe`] has filled them.
    fn observed(&self, frame: &Frame) -> Range<usize> {
        frame.states()
    }

    /// The rows that a network writes to, before [`Physics::act`].
    fn acted(&self, frame: &Frame) -> Range<usize> {
        frame.controls()
    }

    /// Evaluates what the network sees.
    fn observe(&self, _with: Instructions, _frame: &mut Frame, _lanes: usize) {}

    /// Evaluates the controls from what the network says.
    fn act(&self, _with: Instructions, _frame: &mut Frame, _lanes: usize) {}
}
