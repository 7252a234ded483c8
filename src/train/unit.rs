//! What a softened measure counts as one, so that its settings fit margins of any size.

use serde::{Deserialize, Serialize};

use super::rows::Rows;
use crate::model::Model;
use crate::rollout::StateList;

/// The size of margins that counts as one where a measure is softened and scaled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number above 0, or \"margins\"")]
pub enum Unit {
    /// A number.
    Given(f64),
    /// A size that is looked for in the margins of starts.
    Found(Found),
}

/// Where a size is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Found {
    /// The median size of the smaller margin of the task, over starts.
    Margins,
}

impl Unit {
    /// The number, for `model` at `starts`.
    pub fn number(self, model: &Model, starts: &StateList) -> f64 {
        match self {
            Self::Given(number) => number,
            Self::Found(Found::Margins) => margins(model, starts),
        }
    }
}

/// The smaller of the median sizes of the margins that the task of `model` knows; 1 where neither is a
/// positive number.
fn margins(model: &Model, starts: &StateList) -> f64 {
    let margins = Rows::new(model, starts.view().numbers()).margins();
    let target = median(margins.iter().map(|margins| margins.target));
    let constraint = median(margins.iter().map(|margins| margins.constraint));
    let known = [
        target.filter(|_| model.task.has_target()),
        constraint.filter(|_| model.task.has_constraint()),
    ];
    known.into_iter().flatten().reduce(f64::min).unwrap_or(1.0)
}

/// The median size, where it is finite and above 0.
fn median(margins: impl Iterator<Item = f32>) -> Option<f64> {
    let mut sizes: Vec<f32> = margins.map(f32::abs).filter(|size| size.is_finite()).collect();
    sizes.sort_by(f32::total_cmp);
    sizes.get(sizes.len() / 2).map(|size| f64::from(*size)).filter(|size| *size > 0.0)
}
