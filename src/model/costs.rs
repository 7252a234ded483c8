//! The costs of a plan by name: what they are together, and what each of them comes to.

use super::Model;
use super::lookups::Lookups;
use super::reference::Reference;
use super::stage::StageCost;
use crate::error::{Error, Result};
use crate::formula::{Graph, record};

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
    /// The cost `stage` of plans for `model`, as one that is written in Rust: its terms are `stage`, `map` where
    /// it charges by one, and `end` where the end costs; its contexts are the `references`.
    ///
    /// ```
    /// use reachcast::cost::Quadratic;
    /// use reachcast::model::{Costs, Model, Reference, ReferenceSource, StageCost};
    /// use reachcast::system::DoubleIntegrator;
    /// let system = DoubleIntegrator::default();
    /// let weights = Quadratic { state: [1.0, 0.1], control: [0.0], last: [1.0, 0.1], obstacle: None };
    /// // Where to be, and that no stage is the last.
    /// let fixed = |name: &str| Reference { name: name.into(), source: ReferenceSource::Fixed(0.0) };
    /// let references = ["position", "velocity", "last"].map(fixed).to_vec();
    /// let stage = StageCost::of::<_, _, 2, 1, 3>(system, weights);
    /// let costs = Costs::of(&Model::of(system), stage, references)?;
    /// assert_eq!(costs.shares(&[0.5, 0.0], &[1.0], 0), [0.25]);
    /// # Ok::<(), reachcast::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] for a cost of another model, and for other than a reference for each context.
    pub fn of(model: &Model, stage: StageCost, references: Vec<Reference>) -> Result<Self> {
        stage.check(model)?;
        if references.len() != stage.contexts {
            let problem = format!(
                "{} references for a cost that wants to know {} numbers at each stage",
                references.len(),
                stage.contexts
            );
            return Err(Error::invalid("costs", problem));
        }
        let end = stage.terminal.as_ref().map_or_else(
            || Terms {
                formulas: record(model.inputs() + stage.contexts, |_| Vec::new()),
                lookups: None,
            },
            |end| Terms { formulas: end.formula.clone(), lookups: end.lookups.clone() },
        );
        let term = |name: &str, kind| Term { name: name.to_owned(), kind };
        let map = stage.map.as_ref().map(|_| term("map", TermKind::Stage));
        let ended = stage.terminal.as_ref().map(|_| term("end", TermKind::Terminal));
        Ok(Self {
            terms: [Some(term("stage", TermKind::Stage)), map, ended]
                .into_iter()
                .flatten()
                .collect(),
            parts: [charged(model, &stage), end],
            stage,
            references,
            parameters: model.parameters.iter().map(|parameter| parameter.value).collect(),
            period: model.period.unwrap_or(0.0),
        })
    }

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

/// The terms of a stage: its formula, and what its map charges besides.
fn charged(model: &Model, stage: &StageCost) -> Terms {
    let Some(map) = &stage.map else {
        return Terms { formulas: stage.stage.clone(), lookups: stage.lookups.clone() };
    };
    let (own, known) = (model.inputs(), model.inputs() + stage.contexts);
    let asked = stage.lookups.as_ref().map_or(0, |lookups| lookups.maps.len());
    let formulas = record(known + asked + 1, |x| {
        let paid = stage.stage.eval(&x[..known + asked]);
        vec![paid[0], x[known + asked]]
    });
    let cells = record(known, |x| {
        let asked = stage.lookups.as_ref().map(|lookups| lookups.cells.eval(x));
        [asked.unwrap_or_default(), map.cell.eval(&x[..own])].concat()
    });
    let maps = stage.lookups.iter().flat_map(|lookups| lookups.maps.clone());
    Terms {
        formulas,
        lookups: Some(Lookups { maps: maps.chain([map.map.clone()]).collect(), cells }),
    }
}
