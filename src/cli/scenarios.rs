//! The command `scenarios`: how many scenarios a claim needs.

use serde::Serialize;

use super::args::ScenarioArguments;
use super::options::Global;
use super::{Outcome, document, report};
use crate::error::{Error, Result};
use crate::scenario::bound::{
    per_round, required_scenarios, required_with_failures, simple_scenarios,
};

/// What `scenarios --json` prints.
#[derive(Serialize)]
struct Counts {
    epsilon: f64,
    beta: f64,
    decision_vars: u32,
    rounds: u32,
    beta_per_round: f64,
    simple: u64,
    exact: u64,
    failures: Option<u64>,
    with_failures: Option<u64>,
}

/// Prints the counts of the simple, the exact and, with failures, the Clopper-Pearson bound.
pub(super) fn run(global: &Global, asked: ScenarioArguments) -> Result<Outcome> {
    let ScenarioArguments { epsilon, beta, dim, failures, rounds } = asked;
    if failures.is_some() && dim != 1 {
        let problem = "goes with one decision variable only; leave out --dim";
        return Err(Error::invalid("--failures", problem));
    }
    let flag = |error| match error {
        Error::Invalid { place, problem } if !place.contains(' ') => {
            Error::invalid(format!("--{place}"), problem)
        }
        Error::Invalid { problem, .. } => Error::invalid("--dim", problem),
        other => other,
    };
    let share = per_round(beta, rounds).map_err(flag)?;
    let with_failures = failures.map(|failures| required_with_failures(epsilon, share, failures));
    let counts = Counts {
        epsilon,
        beta,
        decision_vars: dim,
        rounds,
        beta_per_round: share,
        simple: simple_scenarios(epsilon, share, dim).map_err(flag)?,
        exact: required_scenarios(epsilon, share, dim).map_err(flag)?,
        failures,
        with_failures: with_failures.transpose().map_err(flag)?,
    };
    report(global, &document(&counts), || text(&counts))?;
    Ok(Outcome::Done)
}

/// The counts in words.
fn text(counts: &Counts) -> String {
    let Counts { epsilon, beta, decision_vars, rounds, beta_per_round, .. } = counts;
    let mut text = format!("risk {epsilon} with confidence 1 - {beta}");
    if *rounds > 1 {
        text += &format!(", {rounds} rounds of beta {beta_per_round:e}, counts per round");
    }
    text += &format!("\nsimple bound, {decision_vars} decision variable(s): {}\n", counts.simple);
    text += &format!("exact bound,  {decision_vars} decision variable(s): {}\n", counts.exact);
    if let (Some(failures), Some(count)) = (counts.failures, counts.with_failures) {
        text += &format!("at most {failures} failure(s) (Clopper-Pearson): {count}\n");
    }
    text + "simple: (2 / epsilon) (ln(1 / beta) + d) with d decision variables, the numbers that the\n\
            scenarios bound; exact: the smallest count whose binomial tail is at most beta; both count\n\
            scenarios none of which may fail\n"
}
