//! References: numbers that costs are told, which may change from step to step.

use crate::formula::Graph;

/// A number that costs are told at each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Its name.
    pub name: String,
    /// Where it comes from.
    pub source: ReferenceSource,
}

/// Where a reference comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceSource {
    /// The same number at each step.
    Fixed(f32),
    /// A formula of the time in seconds and the number of the step, a single output.
    Formula(Graph),
    /// A number for each step from 0 on, at least one; the last one is held.
    Rows(Vec<f32>),
}

impl Reference {
    /// Its value at a step, where a step lasts `period` seconds. A formula is evaluated in f64 and then
    /// rounded.
    pub fn at(&self, step: u32, period: f32) -> f32 {
        match &self.source {
            ReferenceSource::Fixed(value) => *value,
            ReferenceSource::Formula(formula) => {
                let step = f64::from(step);
                formula.eval(&[step * f64::from(period), step])[0] as f32
            }
            ReferenceSource::Rows(rows) => rows[(step as usize).min(rows.len() - 1)],
        }
    }
}
