//! The costs of a description: terms with names, weights and formulas.

use super::maps::{WrittenMap, maps};
use super::names::Scope;
use super::references::{WrittenReference, references};
use super::section::Section;
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::formula::text::{is_name, shown};
use crate::model::{Term, TermKind};

/// Most costs of a model.
pub const MOST_COSTS: usize = 64;

/// What plans cost, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenCosts {
    /// The terms: those of a stage in the order of the text, then those of the end.
    pub terms: Vec<WrittenTerm>,
    /// What they are told at each step.
    pub references: Vec<WrittenReference>,
    /// The maps that they may ask, in order of their numbers.
    pub maps: Vec<WrittenMap>,
}

/// A cost as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenTerm {
    /// Its name, and when it is paid.
    pub term: Term,
    /// What its formula is multiplied by.
    pub weight: f32,
    /// Its formula.
    pub formula: Written,
}

/// Reads `[model.costs]` with `[model.references]` and `[model.maps]`, which serve nothing else.
pub(super) fn costs(model: &Section<'_>, scope: &Scope) -> Result<Option<WrittenCosts>> {
    let Some(section) = model.section("costs")? else {
        return match ["references", "maps"].into_iter().find(|key| model.has(key)) {
            Some(key) => Err(model.refuse(
                key,
                "nothing reads it: it is for `model.costs`; give that too, or leave this out",
            )),
            None => Ok(None),
        };
    };
    section.only(["stage", "terminal"].into_iter())?;
    let mut inner = scope.clone();
    let references = references(model.section("references")?, scope, &mut inner)?;
    let maps = maps(model.section("maps")?, &mut inner)?;
    let mut all = terms(&section, TermKind::Stage, &inner)?;
    all.extend(terms(&section, TermKind::Terminal, &inner)?);
    if !(1..=MOST_COSTS).contains(&all.len()) {
        let problem = format!(
            "{} costs, expected 1 to {MOST_COSTS}: `stage.NAME = {{ weight = 1.0, formula = \"x^2\" }}`, \
             or `terminal.NAME`",
            all.len()
        );
        return Err(section.refuse_whole(problem));
    }
    Ok(Some(WrittenCosts { terms: all, references, maps }))
}

/// The terms of one kind.
fn terms(costs: &Section<'_>, kind: TermKind, scope: &Scope) -> Result<Vec<WrittenTerm>> {
    let Some(section) = costs.section(kind.name())? else { return Ok(Vec::new()) };
    section.entries().map(|(name, _)| term(&section, name, kind, scope)).collect()
}

fn term(section: &Section<'_>, name: &str, kind: TermKind, scope: &Scope) -> Result<WrittenTerm> {
    if !is_name(name) {
        let problem = format!("`{}`; a name has letters, digits and `_`", shown(name));
        return Err(section.refuse(name, problem));
    }
    let entry = section.required(name, "{ weight = 1.0, formula = \"x^2\" }")?;
    entry.only(["weight", "formula"].into_iter())?;
    let missing = |key: &str, what: &str| entry.refuse(key, format!("missing; expected {what}"));
    let weight = entry.number("weight")?;
    // A negative one is a reward.
    let weight =
        weight.ok_or_else(|| missing("weight", "a number that the formula is multiplied by"))?;
    if !weight.is_finite() {
        let written = entry.written("weight");
        return Err(entry.refuse("weight", format!("{written} is not a finite number as f32")));
    }
    let kind_of_formula = match kind {
        TermKind::Stage => FormulaKind::Stage,
        TermKind::Terminal => FormulaKind::Terminal,
    };
    let written = Written::optional(&entry, "formula", scope, kind_of_formula)?;
    let formula = written.ok_or_else(|| missing("formula", "a formula, lower is better"))?;
    Ok(WrittenTerm { term: Term { name: name.to_owned(), kind }, weight, formula })
}
