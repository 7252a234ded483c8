//! From the costs of a description to those of a plan: recorded, with references, maps and networks read
//! from their files.

use std::sync::Arc;

use super::costs::{WrittenCosts, WrittenTerm};
use super::description::Description;
use super::written::Written;
use crate::cost::CostMap;
use crate::error::Result;
use crate::formula::text::{Networks, Values};
use crate::formula::{Expr, Graph, record};
use crate::model::costs::Terms;
use crate::model::{Costs, Lookups, StageCost, TermKind, TerminalCost};
use crate::real::Real;

/// Key of what is too large as a whole.
const COSTS: &str = "model.costs";

impl Description {
    /// The costs of plans, if the text has any; its references, maps and networks are read from their
    /// files.
    ///
    /// ```
    /// use std::path::Path;
    /// let text = r#"
    /// [model]
    /// name = "cart"
    /// [model.states]
    /// x = { box = [-1.0, 1.0] }
    /// [model.controls]
    /// v = { bounds = [-1.0, 1.0] }
    /// [model.next]
    /// x = "x + 0.1 * v"
    /// [model.task]
    /// kind = "reach"
    /// target = "0.1 - abs(x)"
    /// [model.costs]
    /// stage.place = { weight = 2.0, formula = "(x - goal)^2" }
    /// terminal.place = { weight = 8.0, formula = "(x - goal)^2" }
    /// [model.references]
    /// goal = { formula = "0.5 + 0.25 * step" }
    /// "#;
    /// let description = reachcast::model::text::read(text, "cart.toml", Path::new("."))?;
    /// let costs = description.costs()?.expect("the text has costs");
    /// // Where the goal is at the steps of a plan of two stages that starts at step 4, and at its end.
    /// assert_eq!(costs.contexts(4, 2), [1.5, 1.75, 2.0]);
    /// assert_eq!(costs.shares(&[1.0], &[0.0], 4), [0.5, 2.0]);
    /// # Ok::<(), reachcast::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the key of what cannot be read, does not fit or is too large.
    pub fn costs(&self) -> Result<Option<Costs>> {
        let Some(written) = &self.costs else { return Ok(None) };
        let formulas: Vec<&Written> = written.terms.iter().map(|term| &term.formula).collect();
        let maps = written.maps.iter().map(|map| map.read(&self.origin)).collect::<Result<_>>()?;
        let networks = self.table_with(&formulas)?;
        let recording = Recording { description: self, written, maps, networks };
        recording.costs().map(Some)
    }
}

/// What costs are recorded from.
struct Recording<'a> {
    description: &'a Description,
    written: &'a WrittenCosts,
    maps: Vec<Arc<CostMap>>,
    networks: Networks,
}

/// The maps that some terms ask, and for each lookup of their formulas in order the number of its answer.
struct Asked {
    lookups: Option<Lookups>,
    answers: Vec<usize>,
}

/// The terms of one kind: their sum, and one by one.
struct Part {
    sum: Graph,
    terms: Terms,
}

impl Recording<'_> {
    fn costs(&self) -> Result<Costs> {
        let Description { parameters, period, origin, .. } = self.description;
        let inputs = self.description.inputs();
        let references = self.written.references.iter().map(|found| found.read(inputs, origin));
        let references = references.collect::<Result<Vec<_>>>()?;
        let [stage, end] = [self.part(TermKind::Stage)?, self.part(TermKind::Terminal)?];
        let is_paid = !end.terms.formulas.outputs.is_empty();
        let terminal = TerminalCost { formula: end.sum, lookups: end.terms.lookups.clone() };
        Ok(Costs {
            stage: StageCost::new(stage.sum, references.len(), None)
                .with_lookups(stage.terms.lookups.clone())
                .with_terminal(is_paid.then_some(terminal)),
            terms: self.written.terms.iter().map(|written| written.term.clone()).collect(),
            references,
            parts: [stage.terms, end.terms],
            parameters: parameters.iter().map(|parameter| parameter.value).collect(),
            period: period.unwrap_or(0.0),
        })
    }

    /// The terms of `kind`, recorded.
    fn part(&self, kind: TermKind) -> Result<Part> {
        let terms: Vec<&WrittenTerm> =
            self.written.terms.iter().filter(|written| written.term.kind == kind).collect();
        let asked = self.asked(&terms);
        let count = asked.lookups.as_ref().map_or(0, |lookups| lookups.maps.len());
        let inputs = self.inputs() + count;
        let formulas = record(inputs, |x| self.weighted(&terms, &asked.answers, x));
        let sum = record(inputs, |x| vec![total(&self.weighted(&terms, &asked.answers, x))]);
        self.description.check_size(COSTS, sum.nodes.len())?;
        Ok(Part { sum, terms: Terms { formulas, lookups: asked.lookups } })
    }

    /// Inputs of a formula that asks no map: those of the model, and the references.
    fn inputs(&self) -> usize {
        self.description.inputs() + self.written.references.len()
    }

    /// The values of all names at `inputs`.
    fn names(&self, terms: &[&WrittenTerm], inputs: &[Expr]) -> Vec<Expr> {
        let (model, references) = inputs[..self.inputs()].split_at(self.description.inputs());
        let lets = &self.description.lets;
        let needed = lets.needed(terms.iter().map(|written| &written.formula));
        let mut names = lets.values(model, &needed, &self.networks);
        names.extend(references);
        names
    }

    /// The values of `terms` at `inputs`, each with its weight; `answers` are the numbers of what maps say,
    /// which stands behind the other inputs.
    fn weighted(&self, terms: &[&WrittenTerm], answers: &[usize], inputs: &[Expr]) -> Vec<Expr> {
        let names = self.names(terms, inputs);
        let mut answers = answers.iter().map(|answer| inputs[self.inputs() + answer]);
        let value = |written: &&WrittenTerm| {
            let formula = &written.formula.formula;
            let looked: Vec<Expr> = answers.by_ref().take(formula.lookups().len()).collect();
            let values =
                Values { names: &names, outputs: &[], looked: &looked, networks: &self.networks };
            Expr::lit(written.weight) * formula.value(values)
        };
        terms.iter().map(value).collect()
    }

    /// What `terms` ask, each question once.
    fn asked(&self, terms: &[&WrittenTerm]) -> Asked {
        let formulas = terms.iter().map(|written| &written.formula.formula);
        let numbers: Vec<u32> =
            formulas.flat_map(|formula| formula.lookups()).map(|found| found.map).collect();
        let mut cells = self.cells(terms, &numbers);
        let mut each: Vec<(u32, u32)> = Vec::new();
        let questions = numbers.into_iter().zip(cells.outputs.clone());
        let answers = questions.map(|question| place_in(&mut each, question)).collect();
        cells.outputs = each.iter().map(|(_, cell)| *cell).collect();
        let maps = each.iter().map(|(map, _)| Arc::clone(&self.maps[*map as usize])).collect();
        Asked { lookups: (!each.is_empty()).then_some(Lookups { maps, cells }), answers }
    }

    /// The cells of all lookups of `terms`, which ask the maps of these `numbers`.
    fn cells(&self, terms: &[&WrittenTerm], numbers: &[u32]) -> Graph {
        record(self.inputs(), |inputs| {
            let names = self.names(terms, inputs);
            let values =
                Values { names: &names, outputs: &[], looked: &[], networks: &self.networks };
            let places = terms.iter().flat_map(|written| written.formula.formula.places(values));
            let cell = |(place, map): ([Expr; 2], &u32)| self.maps[*map as usize].cell(place);
            places.zip(numbers).map(cell).collect()
        })
    }
}

/// The place of `question` in `each`, where it is put if it is not there.
fn place_in(each: &mut Vec<(u32, u32)>, question: (u32, u32)) -> usize {
    each.iter().position(|known| *known == question).unwrap_or_else(|| {
        each.push(question);
        each.len() - 1
    })
}

/// The sum from the first to the last; 0 of none.
fn total(values: &[Expr]) -> Expr {
    let sum = values.iter().copied().reduce(|sum, value| sum + value);
    sum.unwrap_or_else(|| Expr::lit(0.0))
}
