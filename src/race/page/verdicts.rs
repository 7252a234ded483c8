//! Words for judges and failure classes, and what a judge counted.

use crate::race::judge::{FailureClass, Judge};
use crate::race::record::{JudgedRecord, StartsRecord};

/// Every class in the order of figures and tables.
pub(in crate::race) const CLASSES: [FailureClass; 7] = FailureClass::ALL;

/// What a judge asks for.
pub(in crate::race) fn rules(judge: Judge) -> &'static str {
    match judge {
        Judge::Study => "the rules of the published code",
        Judge::Paper => {
            "the rules as printed in the paper, the gate in place of the fences where it is crossed"
        }
        Judge::Rigorous => "the same with the cone in its distance form",
    }
}

/// Name of a failure class.
pub(in crate::race) fn class(class: FailureClass) -> &'static str {
    match class {
        FailureClass::UnsafeStart => "unsafe start",
        FailureClass::NotFinite => "not finite",
        FailureClass::Collision => "collision",
        FailureClass::Fence => "fence",
        FailureClass::MissedGate => "missed gate",
        FailureClass::Overtaken => "overtaken",
        FailureClass::Timeout => "timeout",
    }
}

/// How figures show a failure class.
pub(in crate::race) struct Mark {
    /// Its letter; no two share one.
    pub(in crate::race) letter: &'static str,
    /// Its style class.
    pub(in crate::race) style: &'static str,
}

/// The letter and the style class of a failure class.
pub(in crate::race) fn mark(class: FailureClass) -> Mark {
    let (letter, style) = match class {
        FailureClass::UnsafeStart => ("U", "unsafe"),
        FailureClass::NotFinite => ("N", "infinite"),
        FailureClass::Collision => ("C", "collision"),
        FailureClass::Fence => ("F", "fence"),
        FailureClass::MissedGate => ("M", "missed"),
        FailureClass::Overtaken => ("O", "overtaken"),
        FailureClass::Timeout => ("T", "timeout"),
    };
    Mark { letter, style }
}

/// Most races that can be won.
#[derive(Clone, Copy, Debug)]
pub(in crate::race) struct Ceiling {
    /// Starts that are safe before anyone moves.
    pub(in crate::race) safe: u64,
    /// Their share of all starts.
    pub(in crate::race) share: f64,
}

/// The ceiling under `judge`; none without starts.
pub(in crate::race) fn ceiling(starts: &StartsRecord, judge: Judge) -> Option<Ceiling> {
    let safe = starts.ceilings.iter().find(|ceiling| ceiling.judge == judge)?.safe;
    (starts.count > 0).then(|| Ceiling { safe, share: safe as f64 / starts.count as f64 })
}

/// Failures of one class, over all seeds.
pub(in crate::race) fn failures(judged: &JudgedRecord, class: FailureClass) -> u64 {
    let same = judged.failures.iter().filter(|failure| failure.class == class);
    same.map(|failure| failure.count).sum()
}
