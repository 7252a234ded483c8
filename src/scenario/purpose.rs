//! What certificates draw random numbers for.

use crate::rollout::Purpose;

/// Nominal starts of a pilot that fixes the shape of the deviation bound.
pub const PILOT_NOMINAL: Purpose = Purpose::numbered(1);
/// Their perturbations.
pub const PILOT_PERTURBATION: Purpose = Purpose::numbered(2);
/// Nominal starts of the deviation bound.
pub const DEVIATION_NOMINAL: Purpose = Purpose::numbered(3);
/// Their perturbations.
pub const DEVIATION_PERTURBATION: Purpose = Purpose::numbered(4);
/// Nominal starts that estimate the certified set and its conditional failure.
pub const CONDITIONAL_NOMINAL: Purpose = Purpose::numbered(5);
/// Their perturbations.
pub const CONDITIONAL_PERTURBATION: Purpose = Purpose::numbered(6);
/// Starts in the balls of local growth.
pub const GROWTH: Purpose = Purpose::numbered(7);
/// Directions of the boundary search.
pub const DIRECTION: Purpose = Purpose::numbered(8);
/// Starts that a stored certificate is checked with.
pub const CHECK: Purpose = Purpose::numbered(10);
/// Perturbations that a stored certificate is checked with.
pub const CHECK_PERTURBATION: Purpose = Purpose::numbered(11);
/// The rollouts drawn in a report.
pub const PICTURE: Purpose = Purpose::numbered(12);
/// Starts in the sets of local growth upward.
pub const GROWTH_UPWARD: Purpose = Purpose::numbered(30);
/// Starts of the pilot that fixes the axes of an ellipsoid or a box.
pub const GROWTH_PILOT: Purpose = Purpose::numbered(31);
/// Starts of a sequential claim.
pub const SEQUENTIAL: Purpose = Purpose::numbered(32);
/// Their perturbations.
pub const SEQUENTIAL_PERTURBATION: Purpose = Purpose::numbered(33);
