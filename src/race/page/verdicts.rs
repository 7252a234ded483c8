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

/// The letter and the style class of a failure class; no two share a letter.
pub(in crate::race) fn mark(class: FailureClass) -> (&'static str, &'static str) {
    match class {
        FailureClass::UnsafeStart => ("U", "unsafe"),
        FailureClass::NotFinite => ("N", "infinite"),
        FailureClass::Collision => ("C", "collision"),
        FailureClass::Fence => ("F", "fence"),
        FailureClass::MissedGate => ("M", "missed"),
        FailureClass::Overtaken => ("O", "overtaken"),
        FailureClass::Timeout => ("T", "timeout"),
    }
}

/// Starts that `judge` finds safe before anyone moves, and their share.
pub(in crate::race) fn ceiling(starts: &StartsRecord, judge: Judge) -> Option<(u64, f64)> {
    let ceiling = starts.ceilings.iter().find(|ceiling| ceiling.judge == judge)?;
    (starts.count > 0).then(|| (ceiling.safe, ceiling.safe as f64 / starts.count as f64))
}

/// Failures of one class, over all seeds.
pub(in crate::race) fn failures(judged: &JudgedRecord, class: FailureClass) -> u64 {
    let same = judged.failures.iter().filter(|failure| failure.class == class);
    same.map(|failure| failure.count).sum()
}
