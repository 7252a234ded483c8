//! Starts that were tried: how many, the best of them, and those that fail.

use super::domain::Domain;
use super::pairs::{self, NOT_CERTIFIED, halves};
use super::record::{BestStart, FalsifyRecord, Improvement};
use super::settings::FalsifySettings;
use crate::error::Result;
use crate::rollout::{PairControl, Tightening, replay};
use crate::scenario::Context;
use crate::scenario::counterexamples::{FailingPair, FailingStart, failing_pair};

/// Most failing starts that are reported.
const MOST: usize = 20;

/// A start that was tried.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Its coordinates, from -1 to 1.
    pub(super) u: Vec<f64>,
    /// Its measure: of the backend, and where that fails, of f64.
    pub(super) measure: f64,
}

/// What was tried so far.
pub(super) struct Trials<'a> {
    context: Context<'a>,
    settings: &'a FalsifySettings,
    domain: &'a Domain,
    rollouts: u64,
    /// Starts tried that count: of pairs those whose nominal start is certified.
    counted: u64,
    rounds: u64,
    best: Option<BestStart>,
    improvements: Vec<Improvement>,
    found: Vec<FailingStart>,
    /// Starts that fail on the backend and in f64.
    failures: u64,
    /// Starts that fail on the backend alone.
    unconfirmed: u64,
}

impl<'a> Trials<'a> {
    /// Nothing tried yet.
    pub(super) fn new(
        context: Context<'a>,
        settings: &'a FalsifySettings,
        domain: &'a Domain,
    ) -> Self {
        Self {
            context,
            settings,
            domain,
            rollouts: 0,
            counted: 0,
            rounds: 0,
            best: None,
            improvements: Vec::new(),
            found: Vec::new(),
            failures: 0,
            unconfirmed: 0,
        }
    }

    /// Starts tried so far that count: of pairs those whose nominal start is certified.
    pub(super) fn counted(&self) -> u64 {
        self.counted
    }

    /// Rollouts that a start takes.
    fn rollouts_each(&self) -> u64 {
        if self.settings.pairs.is_some() { 2 } else { 1 }
    }

    /// Failing starts so far.
    pub(super) fn failures(&self) -> u64 {
        self.failures
    }

    /// Whether a failing start is found, or the budget spent.
    pub(super) fn is_over(&self) -> bool {
        self.failures > 0 || self.rollouts + self.rollouts_each() > self.settings.budget
    }

    /// Tries the starts at these coordinates, the first of them where the budget does not suffice for
    /// all; the best first.
    ///
    /// # Errors
    /// Those of the backend and of the watch.
    pub(super) fn run(&mut self, at: Vec<Vec<f64>>) -> Result<Vec<Candidate>> {
        self.run_starts(at.iter().map(|u| self.domain.start(u)).collect())
    }

    /// The same for the starts themselves.
    ///
    /// # Errors
    /// As [`Trials::run`].
    pub(super) fn run_starts(&mut self, starts: Vec<Vec<f32>>) -> Result<Vec<Candidate>> {
        let mut tried = self.try_all(starts)?;
        // The order of equal ones is that of their rollouts.
        tried.sort_by(|a, b| a.measure.total_cmp(&b.measure));
        Ok(tried)
    }

    /// The measures of the starts at these coordinates, in their order; none where the budget does not
    /// suffice for all.
    ///
    /// # Errors
    /// As [`Trials::run`].
    pub(super) fn in_order(&mut self, at: Vec<Vec<f64>>) -> Result<Option<Vec<f64>>> {
        let tried = self.try_all(at.iter().map(|u| self.domain.start(u)).collect())?;
        let whole = tried.len() == at.len();
        Ok(whole.then(|| tried.into_iter().map(|one| one.measure).collect()))
    }

    /// Tries starts as far as the budget goes, in their order.
    fn try_all(&mut self, mut starts: Vec<Vec<f32>>) -> Result<Vec<Candidate>> {
        let left = (self.settings.budget - self.rollouts) / self.rollouts_each();
        starts.truncate(usize::try_from(left).unwrap_or(usize::MAX));
        if starts.is_empty() {
            return Ok(Vec::new());
        }
        let measures = self.measures(&starts)?;
        let first = self.rollouts / self.rollouts_each();
        self.rollouts += starts.len() as u64 * self.rollouts_each();
        self.rounds += 1;
        let numbered = (first..).zip(starts.into_iter().zip(measures));
        let judged = numbered.map(|(index, (x, measure))| self.judge(index, x, measure));
        let tried = judged.collect();
        self.found.sort_by(|a, b| a.measure.total_cmp(&b.measure).then(a.index.cmp(&b.index)));
        self.found.truncate(MOST);
        Ok(tried)
    }

    /// The measure of each start on the backend.
    fn measures(&self, starts: &[Vec<f32>]) -> Result<Vec<f32>> {
        let FalsifySettings { spec, pairs, .. } = self.settings;
        match pairs {
            Some(pairs) => pairs::measures(self.context, pairs, spec, starts),
            None => pairs::rolled_out(self.context, spec, &Tightening::none(spec), starts),
        }
    }

    /// The measure in f64, of a pair under the controls that are listed with it.
    fn in_f64(&self, x: &[f32]) -> f64 {
        let (plant, spec) = (self.context.plant(), &self.settings.spec);
        match &self.settings.pairs {
            Some(pairs) => match pairs::in_f64(plant, pairs, spec, x) {
                fails if fails <= 0.0 => f64::from(self.failing_pair(x, 0, pairs.control).measure),
                other => other,
            },
            None => replay::measure(plant, x, spec, &Tightening::none(spec)),
        }
    }

    /// A pair with its controls.
    fn failing_pair(&self, x: &[f32], index: u64, control: PairControl) -> FailingPair {
        let [perturbed, nominal] = halves(x);
        let starts = [nominal, perturbed].map(<[f32]>::to_vec);
        failing_pair(self.context.plant(), starts, &self.settings.spec, control, index)
    }

    /// Takes note of a start; one that fails on the backend is run again in f64.
    fn judge(&mut self, index: u64, x: Vec<f32>, measure: f32) -> Candidate {
        let mut value = f64::from(measure);
        // A measure that is no number is no success.
        if measure.is_nan() || measure <= 0.0 {
            value = self.in_f64(&x);
            if value > 0.0 {
                self.unconfirmed += 1;
            } else {
                self.failures += 1;
                self.found.push(FailingStart { index, x: x.clone(), measure });
            }
        }
        let u = self.domain.coordinates(&x);
        let counts = self.settings.pairs.is_none() || measure < 0.5 * NOT_CERTIFIED;
        self.counted += u64::from(counts);
        if counts && self.best.as_ref().is_none_or(|best| value < best.measure) {
            self.improvements.push(Improvement { index, measure: value });
            self.best = Some(BestStart { index, x, measure: value });
        }
        Candidate { u, measure: value }
    }

    /// What the search came to.
    pub(super) fn record(self, explored: u64, failed: u64, restarts: u64) -> FalsifyRecord {
        let FalsifySettings { budget, seed, spec, .. } = *self.settings;
        let pair =
            |found: &FailingStart, control| self.failing_pair(&found.x, found.index, control);
        let control = self.settings.pairs.as_ref().map(|pairs| pairs.control);
        let failing_pairs: Option<Vec<FailingPair>> =
            control.map(|control| self.found.iter().map(|found| pair(found, control)).collect());
        FalsifyRecord {
            found: !self.found.is_empty(),
            budget,
            rollouts: self.rollouts,
            seed,
            horizon: spec.horizon,
            gamma: spec.gamma,
            uniform: explored,
            uniform_failures: failed,
            restarts,
            rounds: self.rounds,
            best: self.best.map(|best| match self.settings.pairs {
                Some(_) => BestStart { x: halves(&best.x)[0].to_vec(), ..best },
                None => best,
            }),
            improvements: self.improvements,
            failures: self.failures,
            unconfirmed: self.unconfirmed,
            starts: if failing_pairs.is_some() { Vec::new() } else { self.found },
            pairs: failing_pairs.unwrap_or_default(),
        }
    }
}
