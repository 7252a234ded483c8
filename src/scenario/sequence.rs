//! Conditional certificates by fixed sequence: sets from strict to lax, fixed by a pilot, tested one after
//! the other until the first is refused.

use super::bound::{certified_risk, required_with_failures};
use super::drops_record::{LevelRecord, SequenceOutcome, SequenceRecord};
use crate::error::Result;

/// Levels of a sequence.
const LEVELS: usize = 60;
/// Draws that the strictest set is to hold, beside those that the risk needs if none fails.
const START: f64 = 3.0;

/// The levels that a pilot fixed, strict to lax, and what the strictest set is to hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// Descending: a set is the starts with a score above its level.
    pub levels: Vec<f64>,
    /// Draws that the strictest set is to hold; none where no risk is asked for.
    pub start: Option<u64>,
    /// Whether the risk asked for is tested: there are draws enough.
    pub tested: bool,
}

impl Levels {
    /// The levels for the conditional risk `risk` at `beta` over `draws` draws from the box, of which a
    /// pilot has these scores.
    ///
    /// They divide the pilot's starts evenly, from as many as promise the strictest set its draws down to
    /// all whose score is above 0. Where even these are too few, or no risk is asked for, there is one
    /// level: `single`, or the median of the scores above 0 where no start of the pilot lies above that.
    pub fn new(
        mut scores: Vec<f64>,
        draws: u64,
        risk: Option<f64>,
        beta: f64,
        single: f64,
    ) -> Self {
        let starts = scores.len() as f64;
        scores.retain(|score| *score > 0.0);
        scores.sort_unstable_by(|a, b| b.total_cmp(a));
        let start = risk.map(|risk| (START * beta.ln() / (-risk).ln_1p()).ceil());
        let first = start.map(|start| start / draws as f64 * starts);
        match first {
            Some(first) if first <= scores.len() as f64 => Self {
                levels: divided(&scores, first),
                start: start.map(|start| start as u64),
                tested: true,
            },
            _ => {
                let bears = scores.first().is_some_and(|most| *most > single);
                let median = below(&scores, scores.len() / 2);
                let levels = vec![if bears { single } else { median }];
                Self { levels, start: start.map(|start| start as u64), tested: false }
            }
        }
    }
}

/// The largest of the descending `scores` that at least `count` of them, and one, lie above; 0 where there is
/// none: the laxest set is all starts whose own rollout succeeds. Of starts of one score a set has all or
/// none.
fn below(scores: &[f64], count: usize) -> f64 {
    let count = count.max(1);
    let Some(last) = scores.get(count - 1) else { return 0.0 };
    scores[count..].iter().copied().find(|score| score < last).unwrap_or(0.0)
}

/// Levels below the first `first` of the descending `scores`, and so on to all of them, evenly.
fn divided(scores: &[f64], first: f64) -> Vec<f64> {
    let step = (scores.len() as f64 - first) / (LEVELS - 1) as f64;
    let at = |number: usize| below(scores, (first + number as f64 * step).ceil() as usize);
    let mut levels: Vec<f64> = (0..LEVELS).map(at).collect();
    levels.dedup();
    levels
}

/// How many draws each set holds beyond the one before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Counts {
    /// For each level, draws of which it is the strictest set that holds them.
    accepted: Vec<u64>,
    /// Of which the perturbed rollout failed.
    failures: Vec<u64>,
}

impl Counts {
    /// No draw yet, for `levels` levels.
    pub fn new(levels: usize) -> Self {
        Self { accepted: vec![0; levels], failures: vec![0; levels] }
    }

    /// Adds a draw of which `strictest` is the first set that holds it; none does if it is beyond the last.
    pub fn add(&mut self, strictest: usize, failed: Failed) {
        if let (Some(accepted), Some(failures)) =
            (self.accepted.get_mut(strictest), self.failures.get_mut(strictest))
        {
            *accepted += 1;
            *failures += u64::from(failed == Failed::Yes);
        }
    }

    /// Draws in each set, and failures among them.
    fn nested(&self) -> impl Iterator<Item = [u64; 2]> {
        let each = self.accepted.iter().zip(&self.failures);
        each.scan([0, 0], |[accepted, failures], (more, failed)| {
            *accepted += more;
            *failures += failed;
            Some([*accepted, *failures])
        })
    }
}

/// Whether the perturbed rollout of a draw failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failed {
    /// It did not reach the target safely.
    Yes,
    /// It did.
    No,
}

/// Tests level after level at the full beta and stops at the first that is refused: the first set whose
/// risk is above the one asked for is accepted with probability at most beta, so the last one accepted has
/// it with confidence 1 - beta, section 4 of `docs/method.md`.
///
/// Where the strictest is refused, it is reported with the risk obtained. That costs no beta either: its
/// bound is wrong in the same event, whether it is accepted or refused.
///
/// # Errors
/// [`crate::Error::Invalid`] for a risk or beta outside (0, 1).
pub fn test(
    levels: &Levels,
    counts: &Counts,
    risk: Option<f64>,
    beta: f64,
    pilot: u64,
) -> Result<SequenceRecord> {
    let asked = risk.filter(|_| levels.tested);
    let (mut records, mut chosen, mut going) = (Vec::new(), None, true);
    for (number, (&level, [accepted, failures])) in
        levels.levels.iter().zip(counts.nested()).enumerate()
    {
        if !going {
            records.push(LevelRecord { level, accepted: None, failures: None, risk: None });
            continue;
        }
        let upper = certified_risk(accepted, failures, beta);
        let (accepted, failures) = (Some(accepted), Some(failures));
        records.push(LevelRecord { level, accepted, failures, risk: Some(upper) });
        going = asked.is_some_and(|asked| upper <= asked);
        if going {
            chosen = Some(number);
        }
    }
    let outcome = match (asked, chosen) {
        (None, _) => SequenceOutcome::Single,
        (Some(_), Some(_)) => SequenceOutcome::Accepted,
        (Some(_), None) => SequenceOutcome::Refused,
    };
    Ok(SequenceRecord {
        risk,
        pilot,
        start: levels.start,
        required: risk.map(|risk| required_with_failures(risk, beta, 0)).transpose()?,
        outcome,
        levels: records,
        chosen: chosen.unwrap_or(0),
    })
}

/// What `stored` says as its own counts give it.
///
/// # Errors
/// As [`test`].
pub(super) fn derived(
    stored: &SequenceRecord,
    risk: Option<f64>,
    beta: f64,
) -> Result<SequenceRecord> {
    let mut counts = Counts::new(stored.levels.len());
    let mut before = [0, 0];
    for (number, level) in stored.levels.iter().enumerate() {
        let [accepted, failures] = [level.accepted, level.failures].map(Option::unwrap_or_default);
        counts.accepted[number] = accepted.saturating_sub(before[0]);
        counts.failures[number] = failures.saturating_sub(before[1]);
        before = [before[0].max(accepted), before[1].max(failures)];
    }
    let levels = Levels {
        levels: stored.levels.iter().map(|level| level.level).collect(),
        start: stored.start,
        tested: stored.outcome != SequenceOutcome::Single,
    };
    test(&levels, &counts, risk, beta, stored.pilot)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pilot of `count` starts, a third of which have scores above 0, evenly up to 1.
    fn pilot(count: usize) -> Vec<f64> {
        (0..count).map(|i| 1.0 - 3.0 * i as f64 / count as f64).collect()
    }

    #[test]
    fn levels_descend_from_the_draws_that_the_first_needs() {
        let levels = Levels::new(pilot(4096), 20_000, Some(0.005), 1e-3, 0.5);
        // 3 ln(0.001) / ln(0.995), of 20,000.
        assert_eq!((levels.start, levels.tested, levels.levels.len()), (Some(4135), true, 60));
        assert!(levels.levels.windows(2).all(|pair| pair[0] > pair[1]));
        assert!((levels.levels[0] - (1.0 - 3.0 * 0.20675)).abs() < 2e-3, "{:?}", levels.levels[0]);
        assert_eq!(levels.levels[59], 0.0);
    }

    /// A margin that saturates gives many starts one score: no level may leave them all out.
    #[test]
    fn starts_of_one_score_are_in_one_set() {
        let ties: Vec<f64> = (0..4096).map(|i| if i < 3000 { 2.0 } else { 1.0 }).collect();
        let levels = Levels::new(ties.clone(), 20_000, Some(0.005), 1e-3, 0.5);
        assert_eq!((levels.levels, levels.tested), (vec![1.0, 0.0], true));
        assert_eq!(Levels::new(ties, 20_000, None, 1e-3, 2.0).levels, [1.0]);
        let all = Levels::new(vec![2.0; 4096], 20_000, Some(0.005), 1e-3, 2.0);
        assert_eq!(all.levels, [0.0]);
    }

    #[test]
    fn too_few_draws_leave_one_level() {
        let few = Levels::new(pilot(4096), 2000, Some(0.005), 1e-3, 0.5);
        assert_eq!((few.levels, few.tested), (vec![0.5], false));
        let strict = Levels::new(pilot(4096), 2000, None, 1e-3, 2.0);
        assert!(strict.start.is_none() && (strict.levels[0] - 0.5).abs() < 1e-2, "the median");
        assert_eq!(Levels::new(vec![-1.0; 9], 2000, None, 1e-3, f64::INFINITY).levels, [0.0]);
    }

    /// Counts of sets with these draws and failures beyond the set before.
    fn counts(more: &[[u64; 2]]) -> Counts {
        let mut counts = Counts::new(more.len());
        for (number, [accepted, failures]) in more.iter().enumerate() {
            (0..*accepted).for_each(|i| {
                counts.add(number, if i < *failures { Failed::Yes } else { Failed::No });
            });
        }
        counts.add(more.len(), Failed::Yes);
        counts
    }

    #[test]
    fn the_sequence_stops_at_the_first_refusal() {
        let levels = Levels { levels: vec![3.0, 2.0, 1.0, 0.0], start: Some(1), tested: true };
        // Bounds .0069, .0080, .0053, .0032: the second is above 0.007, the third would be below again.
        let counts = counts(&[[1000, 0], [400, 3], [2000, 0], [4000, 0]]);
        let found = test(&levels, &counts, Some(0.007), 1e-3, 9).expect("a test");
        assert_eq!((found.chosen, found.outcome), (0, SequenceOutcome::Accepted));
        assert_eq!(found.levels[1].failures, Some(3));
        assert!(found.levels[2].accepted.is_none() && found.levels[3].risk.is_none());
        let refused = test(&levels, &counts, Some(0.006), 1e-3, 9).expect("a test");
        assert_eq!((refused.chosen, refused.outcome), (0, SequenceOutcome::Refused));
        let all = test(&levels, &counts, Some(0.01), 1e-3, 9).expect("a test");
        assert_eq!(all.chosen, 3);
        for found in [found, refused, all] {
            assert_eq!(derived(&found, found.risk, 1e-3).expect("the same"), found);
        }
    }
}
