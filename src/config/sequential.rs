//! The section `[sequential]`: a claim whose starts are looked at one after the other.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::scenario::limits::positive_f32;
use crate::scenario::sequential_record::{SequentialOf, SequentialSettings};

/// A claim whose starts are looked at one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SequentialSection {
    /// Whose starts: `none` for no such claim, `set`, `box` or `ball`.
    pub of: SequentialOf,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Most draws.
    pub most: u64,
    /// Radius of the ball around the state.
    pub radius: f64,
    /// Natural logarithm of the product of the e-values of all earlier attempts.
    pub carried: f64,
}

impl Default for SequentialSection {
    fn default() -> Self {
        Self {
            of: SequentialOf::None,
            epsilon: 0.1,
            beta: 1e-3,
            most: 20_000,
            radius: 0.1,
            carried: 0.0,
        }
    }
}

impl SequentialSection {
    /// What is asked for, if anything.
    pub(super) fn settings(&self) -> Result<Option<SequentialSettings>> {
        let Self { of, epsilon, beta, most, carried, .. } = *self;
        let radius = positive_f32("sequential.radius", self.radius)?;
        let asked = SequentialSettings { of, epsilon, beta, most, radius, carried };
        asked.check()?;
        Ok((of != SequentialOf::None).then_some(asked))
    }
}
