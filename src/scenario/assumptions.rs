//! What Lipschitz constants rest on beside arithmetic, what speaks against them, and whether the user
//! answers for it.

use super::constant_record::{Assumption, ConstantRecord, ConstantsRecord};
use crate::rounding::{lower, upper};

/// Share of a constant by which a slope may exceed it for its own rounding.
const ROUNDING: f64 = 1e-9;
/// The source of a constant that was given.
pub(super) const GIVEN: &str = "given";

impl ConstantRecord {
    /// Whether a slope between two sampled states exceeds the constant: a proof that it is too small.
    pub fn is_refuted(&self) -> bool {
        self.sampled > self.used * (1.0 + ROUNDING)
    }

    /// Whether it was computed with what `flag` says.
    fn rests_on(&self, flag: Option<bool>) -> bool {
        self.source != GIVEN && flag == Some(true)
    }

    /// Whether it assumes that branches agree where they switch.
    fn assumes_continuity(&self) -> bool {
        self.rests_on(self.assumed_continuous)
    }

    /// Whether it was bounded with hulls.
    fn is_hulled(&self) -> bool {
        self.rests_on(self.hulled)
    }
}

impl ConstantsRecord {
    /// Both, with the names of their margins.
    fn named(&self) -> [(&'static str, &ConstantRecord); 2] {
        [("target", &self.target), ("constraint", &self.constraint)]
    }

    /// Whether no sampled slope speaks against a constant, and the user has confirmed what they rest on.
    pub fn stand(&self) -> bool {
        let confirmed = |needed: bool, by| !needed || self.assumed.contains(&by);
        self.named().iter().all(|(_, constant)| {
            !constant.is_refuted()
                && confirmed(constant.assumes_continuity(), Assumption::Continuous)
                && confirmed(constant.is_hulled(), Assumption::Hulled)
        })
    }

    /// What is to be said of them: nothing where they were computed without an assumption.
    pub fn statements(&self) -> Vec<String> {
        let of = |(name, constant): (&str, &ConstantRecord)| {
            [
                refuted(name, constant),
                below(name, constant),
                constant.assumes_continuity().then(|| self.continuous(name)),
                constant.is_hulled().then(|| self.hulled(name)),
            ]
        };
        self.named().into_iter().flat_map(of).flatten().collect()
    }

    fn continuous(&self, name: &str) -> String {
        let how = "assumes that the two sides of its branches agree where they switch, which could not be \
                   shown";
        match self.assumed.contains(&Assumption::Continuous) {
            true => {
                format!("The constant of the {name} margin {how}, and was confirmed by the user.")
            }
            false => format!(
                "CAUTION: the constant of the {name} margin {how}: where the margin jumps it is too small. \
                 Write the margin with `min`, `max`, `abs` or `clamp`, or confirm that it is continuous with \
                 `constants.assume = [\"continuous\"]`."
            ),
        }
    }

    fn hulled(&self, name: &str) -> String {
        let how =
            "was bounded with hulls in the place of pieces: it is valid, and larger than need be";
        match self.assumed.contains(&Assumption::Hulled) {
            true => format!("The constant of the {name} margin {how}, which the user confirmed."),
            false => format!(
                "CAUTION: the constant of the {name} margin {how}. Write the margin with fewer branches, \
                 give the constant, or confirm this one with `constants.assume = [\"hulled\"]`."
            ),
        }
    }
}

/// That a sampled slope exceeds the constant.
fn refuted(name: &str, constant: &ConstantRecord) -> Option<String> {
    constant.is_refuted().then(|| {
        format!(
            "The constant of the {name} margin is wrong: {} is used, and between two states that were \
             sampled the margin changes by at least {} per unit of distance, which proves it. The bound \
             that the certified set rests on is none: let the constant be computed.",
            upper(constant.used),
            lower(constant.sampled)
        )
    })
}

/// That a constant was given below the bound that was computed, where no sample refutes it.
fn below(name: &str, constant: &ConstantRecord) -> Option<String> {
    let under = constant.source == GIVEN && constant.used * (1.0 + ROUNDING) < constant.computed;
    (under && !constant.is_refuted()).then(|| {
        let computed = match constant.computed {
            computed if computed.is_finite() => format!("the computed bound {}", upper(computed)),
            _ => "every bound that could be computed: there is none".to_owned(),
        };
        format!(
            "CAUTION: the constant given for the {name} margin, {}, is below {computed}. The largest slope \
             of a sample, {}, does not exceed it, which is no proof.",
            upper(constant.used),
            lower(constant.sampled)
        )
    })
}
