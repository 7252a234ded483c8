//! Intermediate formulas: in any order in the text, evaluated after what they use.

use super::names::Scope;
use super::section::Section;
use super::written::{FormulaKind, Written};
use crate::error::{Error, Result};
use crate::formula::Scalar;
use crate::formula::text::{Networks, Use, Values};

/// Named formulas that others use.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Lets {
    /// In the order of the text.
    formulas: Vec<Written>,
    /// Their numbers, each after those that it uses.
    order: Vec<usize>,
    /// The place of the first.
    first: usize,
}

/// How far the search for an order has come with a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mark {
    New,
    Open,
    Done,
}

/// A formula whose uses are being followed.
struct Open {
    formula: usize,
    uses: std::vec::IntoIter<Use>,
}

impl Lets {
    /// Reads `[model.let]` and adds its names to `scope`.
    pub(super) fn read(section: Option<Section<'_>>, scope: &mut Scope) -> Result<Self> {
        let first = scope.names.len();
        let Some(section) = section else { return Ok(Self { first, ..Self::default() }) };
        for (key, _) in section.entries() {
            scope.declare(&section, key, "an intermediate formula")?;
        }
        let read = |(key, value)| Written::read(&section, key, value, scope, FormulaKind::Dynamics);
        let formulas = section.entries().map(read).collect::<Result<Vec<_>>>()?;
        let mut lets = Self { formulas, order: Vec::new(), first };
        lets.sort(&section)?;
        lets.note_deeds(scope);
        Ok(lets)
    }

    /// All of them, in the order of the text.
    pub(super) fn written(&self) -> &[Written] {
        &self.formulas
    }

    /// The intermediate formulas that formula `i` uses, by their numbers.
    fn uses(&self, i: usize) -> Vec<Use> {
        self.among(self.formulas[i].formula.names())
    }

    /// Those of `uses` that are intermediate formulas, by their numbers.
    fn among(&self, uses: impl Iterator<Item = Use>) -> Vec<Use> {
        let first = self.first as u32;
        // Behind them are the references of costs.
        let own = first..first + self.formulas.len() as u32;
        uses.filter(|found| own.contains(&found.number))
            .map(|found| Use { number: found.number - first, ..found })
            .collect()
    }

    /// Finds the order of evaluation: as in the text, but for what has to come before. On a stack
    /// of its own, as chains may be long.
    fn sort(&mut self, section: &Section<'_>) -> Result<()> {
        let mut marks = vec![Mark::New; self.formulas.len()];
        let mut stack: Vec<Open> = Vec::new();
        for root in 0..self.formulas.len() {
            let mut next = (marks[root] == Mark::New).then_some(root);
            loop {
                if let Some(formula) = next.take() {
                    marks[formula] = Mark::Open;
                    stack.push(Open { formula, uses: self.uses(formula).into_iter() });
                }
                let Some(top) = stack.last_mut() else { break };
                match top.uses.next() {
                    None => {
                        marks[top.formula] = Mark::Done;
                        self.order.push(top.formula);
                        stack.pop();
                    }
                    Some(Use { number, at }) => match marks[number as usize] {
                        Mark::New => next = Some(number as usize),
                        Mark::Open => return Err(self.cycle(section, &stack, number as usize, at)),
                        Mark::Done => {}
                    },
                }
            }
        }
        Ok(())
    }

    /// The refusal of a cycle that closes at byte `at` of the last open formula, back to `start`.
    fn cycle(&self, section: &Section<'_>, stack: &[Open], start: usize, at: usize) -> Error {
        let from = stack.iter().position(|open| open.formula == start).unwrap_or(0);
        let name = |i: usize| {
            let key = self.formulas[i].key.as_str();
            format!("`{}`", key.rsplit('.').next().unwrap_or(key))
        };
        let path = stack[from..].iter().map(|open| open.formula).chain([start]);
        let most = 12;
        let mut names: Vec<String> = path.map(name).collect();
        if names.len() > most {
            names.splice(most / 2..names.len() - most / 2, ["...".to_owned()]);
        }
        let last = stack.last().map_or(start, |open| open.formula);
        let problem = format!("a cycle: {}", names.join(" uses "));
        self.formulas[last].refuse(section.origin, at, problem)
    }

    /// Tells `scope` which intermediate formulas use a control or a disturbance.
    fn note_deeds(&self, scope: &mut Scope) {
        for &i in &self.order {
            let mut uses = self.formulas[i].formula.names();
            let deed = uses.find_map(|found| scope.deed_behind(found.number));
            scope.note_deed(self.first + i, deed);
        }
    }

    /// Which of them `formulas` need, directly or through others.
    pub(super) fn needed<'a>(&self, formulas: impl IntoIterator<Item = &'a Written>) -> Vec<bool> {
        let mut needed = vec![false; self.formulas.len()];
        let mark = |needed: &mut Vec<bool>, uses: Vec<Use>| {
            uses.iter().for_each(|found| needed[found.number as usize] = true);
        };
        for written in formulas {
            mark(&mut needed, self.among(written.formula.names()));
        }
        for &i in self.order.iter().rev() {
            if needed[i] {
                mark(&mut needed, self.uses(i));
            }
        }
        needed
    }

    /// Operations of those that are `needed`.
    pub(super) fn operations(&self, needed: &[bool]) -> usize {
        let counted = self.formulas.iter().zip(needed).filter(|(_, needed)| **needed);
        counted.map(|(written, _)| written.formula.operations()).sum()
    }

    /// The values of all names: the `inputs`, then the intermediate formulas that are `needed`, with the
    /// `networks` that they call; the others have the value of the first input, which nothing asks for.
    /// Disturbances are 0 where `inputs` end before them.
    ///
    /// # Panics
    /// If there is no input.
    pub(super) fn values<R: Scalar>(
        &self,
        inputs: &[R],
        needed: &[bool],
        networks: &Networks,
    ) -> Vec<R> {
        let mut names = inputs.to_vec();
        names.resize(self.first, R::lit(0.0));
        names.resize(self.first + self.formulas.len(), inputs[0]);
        for &i in self.order.iter().filter(|i| needed[**i]) {
            let values = Values { names: &names, outputs: &[], looked: &[], networks };
            names[self.first + i] = self.formulas[i].formula.value(values);
        }
        names
    }
}
