//! Scenario counts that nobody gave: they follow from the claim that is asked for.

use super::section::Config;
use crate::scenario::attempt_share;
use crate::scenario::bound::CountRule;
use crate::scenario::growth_plan::GrowthMethod;
use crate::scenario::settings::Program;

/// Counts by the simple bound what `config` does not give: the pairs of the deviation bound and the
/// starts of a round of growth, where their claim is another than that of the configuration which
/// their number comes from; none for a number that is given.
///
/// A claim that no count supports is left to whoever checks it.
pub(super) fn follow(config: &mut Config, deviation: Option<Config>, growth: Option<Config>) {
    if let Some(standing) = deviation
        && let (Some(is), Some(was)) = (pairs(config), pairs(&standing))
        && is != was
    {
        config.deviation.scenarios = count(&is).unwrap_or(config.deviation.scenarios);
    }
    if let Some(standing) = growth {
        let (is, was) = (starts(config), starts(&standing));
        if is != was {
            config.growth.scenarios = count(&is).unwrap_or(config.growth.scenarios);
        }
    }
}

/// The claim of the deviation bound; none out of range.
fn pairs(config: &Config) -> Option<Program> {
    let mut settings = config.deviation_settings().ok()?;
    settings.beta *= config.attempt.map_or(1.0, attempt_share);
    Some(Program::new(&settings, config.rollout.horizon))
}

/// The claim of a round of growth.
fn starts(config: &Config) -> Program {
    let asked = &config.growth;
    let share = config.attempt.map_or(1.0, attempt_share);
    let splits = asked.split_beta && asked.method == GrowthMethod::Shrinking;
    let rounds = if splits { f64::from(asked.rounds.max(1)) } else { 1.0 };
    Program { decision_vars: 1, epsilon: asked.epsilon, beta: share * asked.beta / rounds }
}

/// The scenarios that a claim needs; none if there is no such number.
fn count(claim: &Program) -> Option<u64> {
    CountRule::Simple.scenarios(claim.epsilon, claim.beta, claim.decision_vars).ok()
}
