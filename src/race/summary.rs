//! From the logs of one controller to its record.

use super::controller::Name;
use super::flight::STEP_SECONDS;
use super::judge::{FailureClass, Judge, verdict};
use super::log::{RaceLog, StepLog};
use super::metrics::{RaceMetrics, mean_metrics};
use super::record::{ControllerRecord, FilterRecord, TierRecord};
use super::statistics::judged;
use crate::race::barrier::FilterStatus;
use crate::scenario::ledger::total;

/// Slack from which a barrier counts as relaxed, m^2.
const RELAXED: f32 = 1e-6;

/// Sums over the control steps that had a plan.
#[derive(Clone, Copy, Debug, Default)]
struct PlanSums {
    effective_samples: Sum,
    best_cost: Sum,
}

impl PlanSums {
    /// Adds the plan of `step`; a cost that is not finite is not counted.
    fn add(&mut self, step: &StepLog) {
        self.effective_samples.add(step.effective_samples);
        self.best_cost.add(step.best_cost.filter(|cost| cost.is_finite()));
    }
}

/// A sum and how many values it is of.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u64,
    sum: f64,
}

impl Sum {
    /// Counts `value` and adds it, if there is one.
    fn add(&mut self, value: Option<f32>) {
        self.count += u64::from(value.is_some());
        self.sum += f64::from(value.unwrap_or(0.0));
    }

    /// The mean; none of no values.
    fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

/// What is kept of the races of one controller.
#[derive(Clone, Debug)]
pub struct Summary {
    name: Name,
    judge: Judge,
    /// Verdicts by judge, `[judges, seeds, starts]`.
    verdicts: [Vec<Vec<Option<FailureClass>>>; 3],
    metrics: Vec<RaceMetrics>,
    tiers: TierRecord,
    tiered: bool,
    filter: FilterRecord,
    non_finite_samples: u64,
    plans: PlanSums,
    /// Compute time of each control step of each race, s.
    pub seconds: Vec<f32>,
}

impl Summary {
    /// No race yet of the controller `name`; `judge` says which races the metrics are of, and
    /// `betas` what the deviation bound and one call of growth spend.
    pub fn new(name: Name, judge: Judge, steps: u32, betas: [f64; 2]) -> Self {
        let tiers = TierRecord {
            occupancy: vec![[0; 5]; steps as usize],
            shares: [0.0; 4],
            growth_calls: 0,
            growth_verified: 0,
            growth_refused: 0,
            growth_rounds: 0,
            f64_reruns: 0,
            beta_deviation: betas[0],
            beta_call: betas[1],
            beta_race: betas[0],
            beta_total: betas[0],
        };
        Self {
            name,
            judge,
            verdicts: Default::default(),
            metrics: Vec::new(),
            tiers,
            tiered: false,
            filter: FilterRecord::default(),
            non_finite_samples: 0,
            plans: PlanSums::default(),
            seconds: Vec::new(),
        }
    }

    /// Begins the races of the next noise seed.
    pub fn next_seed(&mut self) {
        self.verdicts.iter_mut().for_each(|judge| judge.push(Vec::new()));
    }

    /// Adds races of the noise seed begun last, in order of their starts.
    pub fn add(&mut self, races: &[RaceLog]) {
        for race in races {
            for (judge, verdicts) in Judge::ALL.into_iter().zip(&mut self.verdicts) {
                let verdict = verdict(judge, &race.states);
                if judge == self.judge && verdict.is_none() {
                    self.metrics.extend(RaceMetrics::of(&race.states, STEP_SECONDS));
                }
                verdicts.last_mut().expect("a seed was begun").push(verdict);
            }
            self.add_steps(race);
        }
    }

    /// Adds what was decided in a race.
    fn add_steps(&mut self, race: &RaceLog) {
        for (t, counts) in self.tiers.occupancy.iter_mut().enumerate() {
            match race.steps.get(t).map(|step| step.tier) {
                Some(Some(tier)) => counts[usize::from(tier)] += 1,
                Some(None) => {}
                None => counts[4] += 1,
            }
        }
        for step in &race.steps {
            self.tiered |= step.tier.is_some();
            self.seconds.push(step.seconds);
            self.non_finite_samples += u64::from(step.non_finite);
            self.plans.add(step);
            self.tiers.growth_refused += u64::from(step.refused);
            if let Some(ball) = step.ball {
                self.tiers.growth_calls += 1;
                self.tiers.growth_verified += u64::from(ball.verified);
                self.tiers.growth_rounds += u64::from(ball.rounds);
                self.tiers.f64_reruns += u64::from(ball.f64_reruns);
            }
            if let Some((status, slack, active)) = step.filter {
                self.filter.calls += 1;
                self.filter.active += u64::from(active);
                self.filter.relaxed += u64::from(slack > RELAXED);
                self.filter.inaccurate += u64::from(status == FilterStatus::Inaccurate);
                let failed = matches!(status, FilterStatus::Infeasible | FilterStatus::Failed);
                self.filter.failed += u64::from(failed);
            }
        }
        let betas = || race.steps.iter().map(|step| step.beta);
        let spent = total(std::iter::once(self.tiers.beta_deviation).chain(betas()));
        self.tiers.beta_race = self.tiers.beta_race.max(spent);
        self.tiers.beta_total = total(std::iter::once(self.tiers.beta_total).chain(betas()));
    }

    /// Means over the control steps that had a plan: effective samples, and the smallest cost of a
    /// sample where one was finite.
    pub fn plan_means(&self) -> [Option<f64>; 2] {
        [self.plans.effective_samples.mean(), self.plans.best_cost.mean()]
    }

    /// The record; `hybrid` is the controller that the others are compared with, if it ran.
    pub fn record(&self, hybrid: Option<&Self>) -> ControllerRecord {
        let name = self.name.text();
        let hybrid = hybrid.filter(|hybrid| hybrid.name != self.name);
        let judged = Judge::ALL.into_iter().enumerate().map(|(i, judge)| {
            let other = hybrid.map(|hybrid| hybrid.verdicts[i].as_slice());
            judged(judge, name, &self.verdicts[i], other)
        });
        ControllerRecord {
            name: name.to_owned(),
            description: self.name.description().to_owned(),
            judged: judged.collect(),
            metrics: mean_metrics(self.judge, &self.metrics),
            tiers: self.tiered.then(|| self.tier_record()),
            filter: (self.filter.calls > 0).then_some(self.filter),
            non_finite_samples: self.non_finite_samples,
        }
    }

    /// The tiers with their shares of all steps.
    fn tier_record(&self) -> TierRecord {
        let mut tiers = self.tiers.clone();
        let total = |tier: usize| tiers.occupancy.iter().map(|counts| counts[tier]).sum::<u64>();
        let counts = [0, 1, 2, 3].map(total);
        let all = counts.iter().sum::<u64>().max(1);
        tiers.shares = counts.map(|count| count as f64 / all as f64);
        tiers
    }
}
