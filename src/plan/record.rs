//! What plans in closed loop came to: the record that `plan.json` holds and the page reads.

use serde::Serialize;

use super::closed_loop::{Flown, Stopped, Trajectory};
use super::judged::Judged;
use super::settings::FirstPlan;
use crate::backend::Event;
use crate::model::{Costs, Term, TermKind};
use crate::rollout::{MppiSpec, NoiseKind, Sigma};
use crate::scenario::bound;
use crate::scenario::record::{Provenance, SystemRecord};

/// Version of the record's form.
pub const PLAN_SCHEMA: u32 = 1;
/// One minus the confidence of the interval of successes.
const BETA: f64 = 0.05;

/// Everything that is stored of plans in closed loop, but the trajectories.
#[derive(Clone, Debug, Serialize)]
pub struct PlanRecord {
    /// Version of this form, [`PLAN_SCHEMA`].
    pub schema: u32,
    /// Who computed what from which input. The policy is the plan, its digest that of the costs.
    pub provenance: Provenance,
    /// The model, its states with the box that starts are drawn from.
    pub system: SystemRecord,
    /// Control steps of a run.
    pub steps: u32,
    /// Seconds of a control step, where the model says.
    pub period: Option<f32>,
    /// Discount of the measure per step.
    pub gamma: f32,
    /// What plans are improved with.
    pub plans: PlansRecord,
    /// How many runs succeed.
    pub success: SuccessRecord,
    /// What runs cost.
    pub cost: CostRecord,
    /// Effective samples over all steps of all runs.
    pub effective: EffectiveRecord,
    /// How long a control step takes.
    pub latency: LatencyRecord,
    /// The runs in order.
    pub runs: Vec<RunRecord>,
    /// What has to be said beside the figures.
    pub notes: Vec<String>,
    /// What failed on the adapter and was worked around.
    pub events: Vec<Event>,
}

/// What plans are improved with.
#[derive(Clone, Debug, Serialize)]
pub struct PlansRecord {
    /// Samples K.
    pub samples: u32,
    /// Steps H of a plan.
    pub horizon: u32,
    /// Improvements of a plan at each control step.
    pub iterations: u32,
    /// Temperature lambda, in units of cost.
    pub temperature: f32,
    /// Standard deviation of the noise of each control, or the rows of its covariance.
    pub sigma: Vec<Vec<f32>>,
    /// How the noise hangs together over the steps.
    pub noise: NoiseKind,
    /// Whether samples come in mirrored pairs.
    pub antithetic: bool,
    /// Whether samples pay for their noise.
    pub noise_cost: bool,
    /// What the first plan of a run is.
    pub first_plan: FirstPlan,
}

impl PlansRecord {
    /// What `spec` says, with the rest of the settings.
    pub fn new(spec: &MppiSpec, iterations: u32, first_plan: FirstPlan) -> Self {
        let settings = spec.settings();
        Self {
            samples: settings.samples,
            horizon: settings.horizon,
            iterations,
            temperature: settings.temperature,
            sigma: match &settings.sigma {
                Sigma::PerControl(sigma) => vec![sigma.clone()],
                Sigma::Covariance(rows) => rows.clone(),
            },
            noise: settings.noise,
            antithetic: settings.antithetic,
            noise_cost: settings.noise_cost,
            first_plan,
        }
    }
}

/// How many runs succeed.
#[derive(Clone, Debug, Serialize)]
pub struct SuccessRecord {
    /// Runs whose measure is positive.
    pub successes: u64,
    /// Runs.
    pub runs: u64,
    /// Interval of the share of successes (Clopper and Pearson).
    pub interval: [f64; 2],
    /// One minus its confidence.
    pub beta: f64,
    /// What is random in the runs, in words.
    pub of: String,
}

impl SuccessRecord {
    /// Counts the runs.
    pub fn new(judged: &[Judged]) -> Self {
        let (runs, successes) = (judged.len(), judged.iter().filter(|run| run.success()).count());
        let (successes, runs) = (successes as u64, runs as u64);
        let (low, high) = bound::interval(successes, runs, BETA);
        let of = match runs {
            1 => "the noise of the samples, from the configuration's state",
            _ => "starts drawn from the box, and the noise of the samples",
        };
        Self { successes, runs, interval: [low, high], beta: BETA, of: of.to_owned() }
    }
}

/// What runs cost: all stages up to the last control, then the terminal terms at the last state.
#[derive(Clone, Debug, Serialize)]
pub struct CostRecord {
    /// Mean over the runs; of runs that stopped early, what they cost until then.
    #[serde(with = "crate::files::number")]
    pub mean: f64,
    /// The terms in the order of the text.
    pub terms: Vec<TermRecord>,
}

/// A term of the cost.
#[derive(Clone, Debug, Serialize)]
pub struct TermRecord {
    /// Its name.
    pub name: String,
    /// When it is paid.
    #[serde(serialize_with = "kind")]
    pub kind: TermKind,
    /// What it costs in a run, mean over the runs.
    #[serde(with = "crate::files::number")]
    pub mean: f64,
}

impl CostRecord {
    /// Means over `runs`.
    pub fn new(costs: &Costs, runs: &[RunRecord]) -> Self {
        let mean = |of: &dyn Fn(&RunRecord) -> f64| {
            runs.iter().map(of).sum::<f64>() / runs.len().max(1) as f64
        };
        let term = |(i, term): (usize, &Term)| TermRecord {
            name: term.name.clone(),
            kind: term.kind,
            mean: mean(&|run| run.terms[i]),
        };
        let terms = costs.terms.iter().enumerate().map(term).collect();
        Self { mean: mean(&|run| run.cost), terms }
    }
}

/// A kind of term by its name.
fn kind<S: serde::Serializer>(kind: &TermKind, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(kind.name())
}

impl TermRecord {
    /// Its name with its kind in front, as a text has it.
    pub fn key(&self) -> String {
        format!("{}.{}", self.kind.name(), self.name)
    }
}

/// Effective samples, `1 / sum w^2` of the weights of a plan.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct EffectiveRecord {
    /// Fewest of a step.
    pub least: f64,
    /// Median over the steps.
    pub median: f64,
}

impl EffectiveRecord {
    /// Of the plans of some steps; zeros without any.
    pub fn new(steps: impl IntoIterator<Item = f64>) -> Self {
        let sorted = sorted(steps);
        Self { least: quantile(&sorted, 0.0), median: quantile(&sorted, 0.5) }
    }
}

/// Time that a control step takes, milliseconds: contexts, improvement and moving on, for all runs under way.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LatencyRecord {
    /// Plans that are improved at once.
    pub plans: u32,
    /// Median over the steps.
    pub median: f64,
    /// What 95 % of the steps stay at or below.
    pub p95: f64,
    /// The longest step.
    pub most: f64,
    /// The first step, in which an adapter may still make its buffers.
    pub first: f64,
}

impl LatencyRecord {
    /// Of the steps of a closed loop.
    pub fn new(flown: &Flown) -> Self {
        let sorted = sorted(flown.milliseconds.iter().copied());
        Self {
            plans: flown.runs.len() as u32,
            median: quantile(&sorted, 0.5),
            p95: quantile(&sorted, 0.95),
            most: quantile(&sorted, 1.0),
            first: flown.milliseconds.first().copied().unwrap_or(0.0),
        }
    }
}

/// One run.
#[derive(Clone, Debug, Serialize)]
pub struct RunRecord {
    /// Its start, `[states]`.
    pub start: Vec<f32>,
    /// Whether the task holds.
    pub success: bool,
    /// Measure of the task, in f64 on the stored states.
    #[serde(with = "crate::files::number")]
    pub measure: f64,
    /// The first step from which on the task is known to hold.
    pub reached: Option<u32>,
    /// What it cost.
    #[serde(with = "crate::files::number")]
    pub cost: f64,
    /// What each term of the cost came to, in the order of the text.
    #[serde(with = "crate::files::number")]
    pub terms: Vec<f64>,
    /// Effective samples of its plans.
    pub effective: EffectiveRecord,
    /// Why it ended early.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<Stopped>,
}

impl RunRecord {
    /// The figures of a run.
    pub fn new(costs: &Costs, run: &Trajectory, judged: &Judged) -> Self {
        let terms: Vec<f64> = (0..costs.terms.len()).map(|i| total(costs, run, i)).collect();
        Self {
            start: run.states[0].clone(),
            success: judged.success(),
            measure: judged.measure,
            reached: judged.reached,
            cost: terms.iter().sum(),
            terms,
            effective: EffectiveRecord::new(run.effective.iter().copied()),
            stopped: run.stopped.clone(),
        }
    }
}

/// What the term number `i` costs in a run: a stage at every control, a terminal one at the last state.
fn total(costs: &Costs, run: &Trajectory, i: usize) -> f64 {
    let at = |shares: &Vec<f32>| f64::from(shares[i]);
    match costs.terms[i].kind {
        TermKind::Stage => run.shares.iter().take(run.controls.len()).map(at).sum(),
        TermKind::Terminal => run.shares.last().map_or(0.0, at),
    }
}

/// Numbers in ascending order.
fn sorted(numbers: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = numbers.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// The least of `sorted` that `share` of them stay at or below; 0 without any.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_numbers_of_the_list() {
        let numbers = sorted([3.0, 1.0, 4.0, 2.0]);
        let at = |share| quantile(&numbers, share);
        assert_eq!([at(0.0), at(0.5), at(0.95), at(1.0)], [1.0, 2.0, 4.0, 4.0]);
        assert_eq!(quantile(&[], 0.5), 0.0);
        let twenty: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!([quantile(&twenty, 0.95), quantile(&twenty, 0.5)], [19.0, 10.0]);
    }
}
