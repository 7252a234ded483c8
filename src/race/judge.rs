//! Judges: whether a race was won safely, and how it was lost otherwise.

use serde::{Deserialize, Serialize};

use crate::race::system::{Cone, DroneRace};
use crate::system::System;

/// The rules by which a race is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judge {
    /// The published code's.
    Study,
    /// As printed in the paper.
    Paper,
    /// As `Paper`, with the cone in its distance form.
    Rigorous,
}

impl Judge {
    /// Every judge, in the order of tables.
    pub const ALL: [Self; 3] = [Self::Study, Self::Paper, Self::Rigorous];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Study => "study",
            Self::Paper => "paper",
            Self::Rigorous => "rigorous",
        }
    }
}

/// How a race was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureClass {
    /// The judge's rules were violated before anyone moved.
    UnsafeStart,
    /// A number of the state was not finite.
    NotFinite,
    /// Too close to the opponent.
    Collision,
    /// Outside the fences that lead to the gate.
    Fence,
    /// Crossed the gate's plane outside the gate.
    MissedGate,
    /// The opponent was at or past the gate's plane first, or level with the ego.
    Overtaken,
    /// Did not cross the plane in time.
    Timeout,
}

impl FailureClass {
    /// Every class, in the order of tables.
    pub const ALL: [Self; 7] = [
        Self::UnsafeStart,
        Self::NotFinite,
        Self::Collision,
        Self::Fence,
        Self::MissedGate,
        Self::Overtaken,
        Self::Timeout,
    ];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::UnsafeStart => "unsafe-start",
            Self::NotFinite => "not-finite",
            Self::Collision => "collision",
            Self::Fence => "fence",
            Self::MissedGate => "missed-gate",
            Self::Overtaken => "overtaken",
            Self::Timeout => "timeout",
        }
    }
}

/// How a race was lost, `None` for a success.
///
/// `states` are the logged samples `[T + 1]` from the start to the first one at or past the gate's
/// plane, `y_e >= 0` (the crossing sample), or to the last step; what comes after a crossing is not
/// looked at. All is computed in f64 from the f32 samples.
///
/// * At every sample, the crossing one included, all numbers are finite and the judge's distance
///   is kept. `Study`: 3-D distance `>= 0.2 (1 + max(0, z_e - z_o))`. `Paper` and `Rigorous`: the
///   cone of [`DroneRace`] in the squared and in the distance form is positive.
/// * At every sample before the crossing one, `Paper` and `Rigorous` ask for a positive
///   constraint margin, fences included, and for an opponent short of the plane. At the crossing
///   sample the gate takes the place of the fences, which narrow to `|x| < 0.05 - y_e` there.
/// * At the crossing sample `|x_e| <= 0.3`, `|z_e| <= 0.3` and `y_e > y_o`, under every judge.
///
/// The first sample with a violation decides; of several at one sample, the first in the order of
/// [`FailureClass`]. Any violation at the first sample is `UnsafeStart`, and so is a start at or
/// past the plane, which the ego can no longer cross. A race that ends short of the plane is
/// `Overtaken` where the opponent reached it, else `Timeout`, as is a race without samples.
/// `Study` asks for the order of the two at the crossing sample only: there it may still win
/// against an opponent that was on the plane before.
pub fn verdict(judge: Judge, states: &[[f32; 12]]) -> Option<FailureClass> {
    let mut opponent_through = false;
    for (t, state) in states.iter().enumerate() {
        let x = state.map(f64::from);
        let [_, _, ego_y, .., opp_y, _, _, _] = x;
        let violation = violation(judge, x);
        if t == 0 && (violation.is_some() || ego_y >= 0.0) {
            return Some(FailureClass::UnsafeStart);
        }
        if violation.is_some() || ego_y >= 0.0 {
            return violation;
        }
        opponent_through |= opp_y >= 0.0;
    }
    Some(if opponent_through { FailureClass::Overtaken } else { FailureClass::Timeout })
}

/// Whether the judge's rules hold before anyone moves: no controller wins from elsewhere.
pub fn safe_at_start(judge: Judge, start: &[f32; 12]) -> bool {
    verdict(judge, &[*start]) != Some(FailureClass::UnsafeStart)
}

/// The first rule, in the order of [`FailureClass`], that one sample violates.
fn violation(judge: Judge, x: [f64; 12]) -> Option<FailureClass> {
    let [ego_x, _, ego_y, _, ego_z, ..] = x;
    let [.., opp_y, _, _, _] = x;
    let crossed = ego_y >= 0.0;
    let gate = f64::from(DroneRace::GATE);
    let second = if crossed { opp_y >= ego_y } else { judge != Judge::Study && opp_y >= 0.0 };
    if x.iter().any(|value| !value.is_finite()) {
        Some(FailureClass::NotFinite)
    } else if collides(judge, x) {
        Some(FailureClass::Collision)
    } else if !crossed && judge != Judge::Study && race(judge).constraint(x) <= 0.0 {
        // The cone is kept, so it is a fence that is not.
        Some(FailureClass::Fence)
    } else if crossed && ego_x.abs().max(ego_z.abs()) > gate {
        Some(FailureClass::MissedGate)
    } else if second {
        Some(FailureClass::Overtaken)
    } else {
        None
    }
}

/// Whether the drones are closer than the judge allows.
fn collides(judge: Judge, x: [f64; 12]) -> bool {
    let [ego_x, _, ego_y, _, ego_z, _, opp_x, _, opp_y, _, opp_z, _] = x;
    if judge != Judge::Study {
        return race(judge).cone_margin(x) <= 0.0;
    }
    // The published code widens its distance below the ego, the constraint above it.
    let radius = f64::from(DroneRace::CONE) * (1.0 + (ego_z - opp_z).max(0.0));
    (ego_x - opp_x).hypot(ego_y - opp_y).hypot(ego_z - opp_z) < radius
}

/// The race whose constraint the judge reads; the gains play no part in it.
fn race(judge: Judge) -> DroneRace {
    let cone = if judge == Judge::Paper { Cone::Squared } else { Cone::Distance };
    DroneRace { cone, ..DroneRace::default() }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::FailureClass::{
        Collision, Fence, MissedGate, NotFinite, Overtaken, Timeout, UnsafeStart,
    };
    use super::*;
    use crate::files::StateReader;

    /// Positions of the two, at rest.
    fn at(ego: [f32; 3], opponent: [f32; 3]) -> [f32; 12] {
        let ([x, y, z], [ox, oy, oz]) = (ego, opponent);
        [x, 0.0, y, 0.0, z, 0.0, ox, 0.0, oy, 0.0, oz, 0.0]
    }

    /// A race that every judge takes for a success: far ahead, through the middle.
    fn won() -> Vec<[f32; 12]> {
        let along = [-0.3, -0.2, -0.1, 0.02];
        along.map(|y| at([0.0, y, 0.0], [0.0, y - 0.8, 0.0])).to_vec()
    }

    fn verdicts(states: &[[f32; 12]]) -> [Option<FailureClass>; 3] {
        Judge::ALL.map(|judge| verdict(judge, states))
    }

    #[test]
    fn published_starts_violate_as_often_as_published() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/race_starts_500.csv");
        let names = DroneRace::default().states().map(|axis| axis.name);
        let starts = StateReader::open(&path, names.to_vec()).unwrap().next(501).unwrap().arrays();
        assert_eq!(starts.len(), 500);
        let unsafe_starts =
            Judge::ALL.map(|judge| starts.iter().filter(|x| !safe_at_start(judge, x)).count());
        assert_eq!(unsafe_starts, [20, 97, 21]);
    }

    #[test]
    fn a_clean_race_is_won_and_what_follows_is_not_read() {
        let mut states = won();
        assert_eq!(verdicts(&states), [None; 3]);
        states.push([f32::NAN; 12]);
        assert_eq!(verdicts(&states), [None; 3]);
    }

    #[test]
    fn distance_counts_to_the_crossing_sample() {
        for sample in 1..4 {
            let mut states = won();
            // 0.19 beside the ego: within every radius.
            states[sample][6] = 0.19;
            states[sample][8] = states[sample][2] - 0.01;
            assert_eq!(verdicts(&states), [Some(Collision); 3], "sample {sample}");
        }
    }

    #[test]
    fn distances_of_the_judges_differ_in_form_and_height() {
        let second = |opponent: [f32; 3]| {
            let mut states = won();
            states[1] = at([0.0, -0.2, 0.0], opponent);
            verdicts(&states)
        };
        // 0.3 behind: outside 0.2, inside the squared form's 0.447.
        assert_eq!(second([0.0, -0.5, 0.0]), [None, Some(Collision), None]);
        assert_eq!(second([0.0, -0.65, 0.0]), [None; 3]);
        // 0.25 apart in the plane and the opponent 0.5 above: only the constraint widens to 0.3.
        assert_eq!(second([0.0, -0.45, 0.5]), [None, Some(Collision), Some(Collision)]);
        // The opponent 0.5 below: the cone reaches through every height; in 3-D they are 0.51 apart.
        assert_eq!(second([0.0, -0.3, -0.5]), [None, Some(Collision), Some(Collision)]);
        // The study's radius widens where the ego is above: 0.2 (1 + 0.1) > 0.206.
        assert_eq!(second([0.0, -0.38, -0.1]), [Some(Collision); 3]);
        assert_eq!(second([0.0, -0.38, 0.1]), [None, Some(Collision), Some(Collision)]);
    }

    #[test]
    fn study_keeps_its_radius_and_the_others_need_more_than_theirs() {
        // The ego is at the origin, so that the distance is the f32 itself.
        let race =
            |y: f32| [at([0.0, -1.0, 0.0], [0.0, -3.0, 0.0]), at([0.0, 0.0, 0.0], [0.0, y, 0.0])];
        let touching = race(-DroneRace::CONE);
        assert_eq!(verdicts(&touching), [None, Some(Collision), Some(Collision)]);
        let inside = race(-DroneRace::CONE.next_down());
        assert_eq!(verdicts(&inside), [Some(Collision); 3]);
        let outside = race(-DroneRace::CONE.next_up());
        assert_eq!(verdicts(&outside), [None, Some(Collision), None]);
    }

    #[test]
    fn fences_count_before_the_crossing_only() {
        for (axis, sign) in [(0, 1.0), (0, -1.0), (4, 1.0), (4, -1.0)] {
            let mut states = won();
            // |x| = 0.26 against 0.05 + 0.2.
            states[1][axis] = sign * 0.26;
            assert_eq!(verdicts(&states), [None, Some(Fence), Some(Fence)]);
            states[1][axis] = sign * 0.24;
            assert_eq!(verdicts(&states), [None; 3]);
            // At the crossing sample the gate's 0.3 replaces the fence's 0.03.
            states[3][axis] = sign * 0.29;
            assert_eq!(verdicts(&states), [None; 3]);
        }
        // On the fence is outside; this close to the plane it stands at 0.05 exactly.
        let mut states = won();
        states[2] = at([0.05, -f32::MIN_POSITIVE, 0.0], [0.0, -0.9, 0.0]);
        assert_eq!(verdicts(&states), [None, Some(Fence), Some(Fence)]);
        states[2][0] = 0.05_f32.next_down();
        assert_eq!(verdicts(&states), [None; 3]);
    }

    #[test]
    fn gate_is_closed_at_its_edge() {
        for axis in [0, 4] {
            let mut states = won();
            states[3][axis] = -0.3;
            assert_eq!(verdicts(&states), [None; 3]);
            states[3][axis] = 0.3_f32.next_up();
            assert_eq!(verdicts(&states), [Some(MissedGate); 3]);
        }
        // On the plane is across it.
        let mut states = won();
        states[3][2] = 0.0;
        assert_eq!(verdicts(&states), [None; 3]);
    }

    #[test]
    fn who_is_first() {
        // Level at the crossing, 0.25 m and more apart so that no radius interferes.
        let mut states = won();
        states[3] = at([-0.29, 0.02, 0.0], [0.29, 0.02, 0.0]);
        assert_eq!(verdicts(&states), [Some(Overtaken); 3]);
        // Both cross within the step, the ego by more.
        states[3][8] = 0.01;
        assert_eq!(verdicts(&states), [None; 3]);
        // The opponent was on the plane one sample earlier.
        states[2] = at([-0.1, -0.1, 0.0], [0.6, 0.0, 0.0]);
        assert_eq!(verdicts(&states), [None, Some(Overtaken), Some(Overtaken)]);
        states.truncate(3);
        assert_eq!(verdicts(&states), [Some(Overtaken); 3]);
        // Missing the gate comes before coming second.
        let mut both = won();
        both[3] = at([-0.5, 0.02, 0.0], [0.5, 0.1, 0.0]);
        assert_eq!(verdicts(&both), [Some(MissedGate); 3]);
    }

    #[test]
    fn first_violation_decides() {
        let mut states = won();
        states[1][0] = 0.26;
        states[2][6] = 0.1;
        states[2][8] = states[2][2];
        assert_eq!(verdicts(&states), [Some(Collision), Some(Fence), Some(Fence)]);
        states[0][6] = 0.1;
        states[0][8] = states[0][2];
        assert_eq!(verdicts(&states), [Some(UnsafeStart); 3]);
    }

    #[test]
    fn no_crossing_is_a_timeout() {
        assert_eq!(verdicts(&won()[..3]), [Some(Timeout); 3]);
        assert_eq!(verdicts(&[]), [Some(Timeout); 3]);
        assert!(Judge::ALL.iter().all(|&judge| safe_at_start(judge, &won()[0])));
    }

    #[test]
    fn starts_at_the_plane_are_unsafe() {
        for y in [0.0, 0.02] {
            let states = [at([0.0, y, 0.0], [0.0, -0.9, 0.0])];
            assert_eq!(verdicts(&states), [Some(UnsafeStart); 3]);
        }
    }

    #[test]
    fn every_number_has_to_be_finite() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..12 {
                for (sample, class) in [(0, UnsafeStart), (1, NotFinite), (3, NotFinite)] {
                    let mut states = won();
                    states[sample][i] = bad;
                    assert_eq!(verdicts(&states), [Some(class); 3], "{bad} at {i} of {sample}");
                }
            }
        }
    }

    #[test]
    fn names_are_those_that_are_stored() {
        for class in FailureClass::ALL {
            assert_eq!(serde_json::to_value(class).unwrap(), class.name());
        }
        for judge in Judge::ALL {
            assert_eq!(serde_json::to_value(judge).unwrap(), judge.name());
        }
        assert!(FailureClass::ALL.is_sorted());
    }
}
