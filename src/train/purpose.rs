//! What training draws random numbers for.

use crate::rollout::Purpose;

/// Weights of networks before training.
pub const WEIGHT: Purpose = Purpose::numbered(16);
/// Starts, and states, to train on.
pub const START: Purpose = Purpose::numbered(17);
/// Which of the states to train on a batch takes.
pub const CHOICE: Purpose = Purpose::numbered(18);
/// First controls to train on.
pub const CONTROL: Purpose = Purpose::numbered(19);
/// Starts that training is scored on and never sees.
pub const HELD_OUT: Purpose = Purpose::numbered(20);
/// Noise on the controls that reinforcement learning tries.
pub const NOISE: Purpose = Purpose::numbered(21);
