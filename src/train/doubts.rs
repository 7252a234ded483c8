//! What has to be said beside the scores of a run: that next to nothing was learned, or that it was still rising.

use super::record::TrainRecord;
use super::settings::Method;

/// A policy that succeeds from fewer of the held-out starts has learned next to nothing.
const LITTLE: f64 = 0.05;
/// One that succeeds from more has learned its task, whenever it did.
const ENOUGH: f64 = 0.95;

/// What a reader of the scores of a policy has to know, with what may help.
pub(super) fn doubts(record: &TrainRecord) -> Vec<String> {
    let learns_policy = !matches!(record.origin.method, Method::Value | Method::ActionValue);
    let best = record.curve.iter().find(|point| point.iteration == record.best);
    // The first score of a policy is the share of the held-out starts that it succeeds from.
    let share = best.and_then(|best| best.scores.first());
    let Some(&share) = share.filter(|_| learns_policy && record.total > 0) else {
        return Vec::new();
    };
    [idle(record, share), rising(record, share)].into_iter().flatten().collect()
}

/// That nothing was learned, or next to nothing.
fn idle(record: &TrainRecord, share: f64) -> Option<String> {
    let what = match record.best {
        0 if share < 1.0 => {
            "no score was better than that of the untrained policy, which is the one kept"
        }
        1.. if share < LITTLE => {
            "fewer than 5 % of the held-out starts succeed under the policy that is kept"
        }
        _ => return None,
    };
    let (other, own) = match record.origin.method {
        Method::Ppo => ("analytic", "another `--seed`, more of `train.ppo.iterations`, "),
        _ => ("ppo", ""),
    };
    Some(format!(
        "{what}; where rollouts end far from what the task asks, nothing pulls them back. Try a shorter horizon, and \
         the times of the task shortened with it: what is learned on fewer steps may serve the long one too; {own}\
         `--set train.method={other}`; starts nearer to the target (`train.starts`); or a constraint that also holds \
         in what must not run away"
    ))
}

/// That the run ended on its best score.
fn rising(record: &TrainRecord, share: f64) -> Option<String> {
    let rises = record.best == record.total && (LITTLE..ENOUGH).contains(&share);
    let method = record.origin.method.name();
    rises.then(|| {
        format!(
            "the last score is the best one: more of `train.{method}.iterations` may learn more"
        )
    })
}

#[cfg(test)]
mod tests;
