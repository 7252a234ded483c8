//! The costs of a plan by name: what they are together, and what each of them comes to.

use super::lookups::Lookups;
use super::reference::Reference;
use super::stage::StageCost;
use crate::formula::Graph;

/// The costs of a plan, each with its name.
#[derive(Clone, Debug)]
pub struct Costs {
    /// All of them together, as plans are improved by; the references are its contexts.
    pub stage: StageCost,
    /// The terms: those of a stage in the order of the text, then those of the end.
    pub terms: Vec<Term>,
    /// What the contexts are, in their order.
    pub references: Vec<Reference>,
    /// The terms of a stage, and those of the end.
    pub(super) parts: [Terms; 2],
    /// The values of the parameters.
    pub(super) parameters: Vec<f32>,
    /// Seconds between two steps; 0 where the model does not say.
    pub(super) period: f32,
}

/// A cost with its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Term {
    /// Its name.
    pub name: String,
    /// When it is paid.
    pub kind: TermKind,
}

/// When a cost is paid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermKind {
    /// At each stage of a plan.
    Stage,
    /// Once, at the state after the last control.
    Terminal,
}

/// Terms of one kind, one by one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Terms {
    /// An output for each, with its weight.
    pub(super) formulas: Graph,
    /// The maps that they ask.
    pub(super) lookups: Option<Lookups>,
}

impl TermKind {
    /// Its name in a text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stage => "stage",
            Self::Terminal => "terminal",
        }
    }
}

impl Terms {
    /// What each comes to at `inputs`, those of the model and the contexts.
    fn values(&self, inputs: &[f32]) -> Vec<f32> {
        let said = self.lookups.as_ref().map(|lookups| lookups.values(inputs));
        self.formulas.eval(&[inputs, &said.unwrap_or_default()].concat())
    }
}

impl Costs {
    /// The contexts of a plan that starts at `first_step`, `[rows, references]`: a row for each of its
    /// `horizon` stages, and one for the end where there is a terminal cost. What
    /// [`crate::rollout::MppiProblem::context`] is.
    pub fn contexts(&self, first_step: u32, horizon: usize) -> Vec<f32> {
        let rows = self.stage.rows(horizon) as u32;
        (0..rows).flat_map(|row| self.row(first_step.saturating_add(row))).collect()
    }

    /// What each term costs at the state `x` under the control `u` at a step, with its weight, in the
    /// order of the terms; those of the end as if a plan ended at `x`.
    pub fn shares(&self, x: &[f32], u: &[f32], step: u32) -> Vec<f32> {
        let time = [step as f32 * self.period, step as f32];
        let inputs = [x, u, &self.parameters, &time, &self.row(step)].concat();
        self.parts.iter().flat_map(|terms| terms.values(&inputs)).collect()
    }

    /// The references at a step.
    fn row(&self, step: u32) -> Vec<f32> {
        self.references.iter().map(|reference| reference.at(step, self.period)).collect()
    }
}
