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
/// Starts that a search for failures tries.
pub const FALSIFY: Purpose = Purpose::numbered(22);
/// Nominal starts of the pilot that fixes the shapes of margin drops, and the levels of the sequence.
pub const DROPS_PILOT_NOMINAL: Purpose = Purpose::numbered(30);
/// Their perturbations.
pub const DROPS_PILOT_PERTURBATION: Purpose = Purpose::numbered(31);
/// Nominal starts of the bound on margin drops.
pub const DROPS_NOMINAL: Purpose = Purpose::numbered(32);
/// Their perturbations.
pub const DROPS_PERTURBATION: Purpose = Purpose::numbered(33);
/// Fresh starts that estimate the share of sets that were chosen.
pub const FRESH_SHARE: Purpose = Purpose::numbered(34);
/// Nominal starts of the calibration of the score.
pub const CALIBRATION_NOMINAL: Purpose = Purpose::numbered(35);
/// Their perturbations.
pub const CALIBRATION_PERTURBATION: Purpose = Purpose::numbered(36);
/// Nominal starts that the deviation bound of a stored certificate is checked with.
pub const FRESH_NOMINAL: Purpose = Purpose::numbered(24);
/// Their perturbations.
pub const FRESH_PERTURBATION: Purpose = Purpose::numbered(25);
/// Perturbations that certified starts of a deterministic certificate are checked with.
pub const DETERMINISTIC_ADVERSARY: Purpose = Purpose::numbered(23);
/// Starts of the certified share of a deterministic certificate.
pub const DETERMINISTIC: Purpose = Purpose::numbered(26);
/// Starts in the sets of local growth upward.
pub const GROWTH_UPWARD: Purpose = Purpose::numbered(27);
/// Starts of the pilot that fixes the axes of an ellipsoid or a box.
pub const GROWTH_PILOT: Purpose = Purpose::numbered(28);
/// Starts of a sequential claim.
pub const SEQUENTIAL: Purpose = Purpose::numbered(29);
/// Their perturbations.
pub const SEQUENTIAL_PERTURBATION: Purpose = Purpose::numbered(37);
