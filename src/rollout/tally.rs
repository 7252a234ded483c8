//! Improved plans by parts: blocks of samples, added in any order and cut, merged to the same bits.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::mppi::MppiSpec;
use super::planning::{MppiProblem, MppiResult, Planning};
use super::tally_origin::Origin;
use crate::error::{Error, Result};

/// The samples of a block, weighted against the smallest cost among them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Partial {
    /// Number of samples.
    pub(crate) count: u32,
    /// Smallest cost; infinite where none is finite.
    pub(crate) least: f32,
    /// The sample that has it, the first of equal ones.
    pub(crate) best: u32,
    /// Sum of the weights `exp(-(S - least) / lambda)`.
    pub(crate) weight: f64,
    /// Sum of their squares.
    pub(crate) squares: f64,
    /// Sum of the finite costs.
    pub(crate) cost: f64,
    /// Samples whose cost is not finite.
    pub(crate) non_finite: u32,
    /// Weighted sum of the controls, `[H, controls]`.
    pub(crate) controls: Vec<f64>,
}

impl Partial {
    /// No sample, for plans of `length` controls in all.
    fn none(length: usize) -> Self {
        Self {
            count: 0,
            least: f32::INFINITY,
            best: 0,
            weight: 0.0,
            squares: 0.0,
            cost: 0.0,
            non_finite: 0,
            controls: vec![0.0; length],
        }
    }

    /// Adds the samples of `other`, which come after these.
    fn merge(&mut self, other: &Self, temperature: f32) {
        let least = self.least.min(other.least);
        let scale = |part: f32| {
            // An empty part has no weight to scale.
            let excess = f64::from(part) - f64::from(least);
            if part.is_finite() { (-excess / f64::from(temperature)).exp() } else { 0.0 }
        };
        let (mine, theirs) = (scale(self.least), scale(other.least));
        if other.least < self.least {
            self.best = other.best;
        }
        self.least = least;
        self.count += other.count;
        self.weight = mine * self.weight + theirs * other.weight;
        self.squares = mine * mine * self.squares + theirs * theirs * other.squares;
        self.cost += other.cost;
        self.non_finite += other.non_finite;
        for (sum, more) in self.controls.iter_mut().zip(&other.controls) {
            *sum = mine * *sum + theirs * more;
        }
    }

    /// The result around the plan of `problem`.
    fn finish(self, spec: &MppiSpec, problem: &MppiProblem, costs: Vec<f32>) -> MppiResult {
        let bounds = || spec.settings().bounds.iter().cycle();
        let clip = |u: f32, [low, high]: &[f32; 2]| u.clamp(*low, *high);
        let found = self.weight > 0.0;
        let mean = |(sum, bounds): (&f64, _)| clip((sum / self.weight) as f32, bounds);
        let plan = match found {
            true => self.controls.iter().zip(bounds()).map(mean).collect(),
            false => {
                problem.plan.iter().zip(bounds()).map(|(u, within)| clip(*u, within)).collect()
            }
        };
        MppiResult {
            plan,
            least_cost: self.least,
            mean_cost: self.cost / f64::from((self.count - self.non_finite).max(1)),
            effective_samples: if found { self.weight * self.weight / self.squares } else { 0.0 },
            best: self.best,
            non_finite: self.non_finite,
            costs,
        }
    }
}

/// What some samples of a problem come to: blocks by the number of their first sample.
///
/// Blocks are merged in order when the tally is finished, so its bits depend on how the samples are
/// cut into blocks, and neither on who ran which range nor on the order in which tallies met. A tally
/// knows the plans, the problem and the iteration that it is of; an empty one is of any.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanTally {
    /// What it is of; none before it has met another.
    origin: Option<Origin>,
    blocks: BTreeMap<u32, Block>,
}

/// A block of samples.
#[derive(Clone, Debug, PartialEq)]
struct Block {
    partial: Partial,
    /// The cost of each, if asked for.
    costs: Vec<f32>,
}

impl PlanTally {
    /// Adds the block of samples from number `first` on, and the cost of each if asked for.
    pub(crate) fn add(&mut self, first: u32, partial: Partial, costs: Vec<f32>) {
        self.blocks.insert(first, Block { partial, costs });
    }

    /// The same, known to be of `origin`.
    pub(crate) fn of(self, origin: Origin) -> Self {
        Self { origin: Some(origin), ..self }
    }

    /// Samples so far.
    pub fn samples(&self) -> u32 {
        self.blocks.values().map(|block| block.partial.count).sum()
    }

    /// Adds the samples of `other`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if both have the same sample, or if they are of different plans, problems or
    /// iterations, saying what differs; neither is changed then.
    pub fn merge(&mut self, other: Self) -> Result<()> {
        if let (Some(origin), Some(another)) = (&self.origin, &other.origin) {
            origin.check_same(another)?;
        }
        for (&first, block) in &other.blocks {
            let end = first + block.partial.count;
            let before = self.blocks.range(..end).next_back();
            let taken = before.filter(|(at, known)| *at + known.partial.count > first);
            if let Some((at, known)) = taken {
                let problem = format!(
                    "the samples {first}..{end} meet those of {at}..{}, which it has already",
                    at + known.partial.count
                );
                return Err(Error::invalid("tally", problem));
            }
        }
        self.origin = self.origin.take().or(other.origin);
        self.blocks.extend(other.blocks);
        Ok(())
    }

    /// Refuses plans and a problem that this is not of.
    ///
    /// # Errors
    /// [`Error::Invalid`] saying what differs.
    pub(crate) fn check(&self, planning: &Arc<Planning>, problem: &MppiProblem) -> Result<()> {
        self.origin.as_ref().map_or(Ok(()), |origin| origin.check(planning, problem))
    }

    /// The improved plan of `problem`, which this is of.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first sample that is missing.
    pub(crate) fn finish(self, spec: &MppiSpec, problem: &MppiProblem) -> Result<MppiResult> {
        let settings = spec.settings();
        let mut all = Partial::none(spec.horizon() * spec.controls());
        let mut costs = Vec::new();
        for (first, block) in self.blocks {
            if first != all.count {
                return Err(missing(all.count, settings.samples));
            }
            all.merge(&block.partial, settings.temperature);
            costs.extend(block.costs);
        }
        if all.count != settings.samples {
            return Err(missing(all.count, settings.samples));
        }
        Ok(all.finish(spec, problem, costs))
    }
}

fn missing(first: u32, samples: u32) -> Error {
    Error::invalid(
        "tally",
        format!("sample {first} of {samples} is missing; merge its range first"),
    )
}
