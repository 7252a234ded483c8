//! Names of formulas that a plant may be driven by: the refusal of one that it does not have.

use crate::error::Error;

/// The refusal of the formula `name`.
pub(crate) fn no_formula(system: &str, name: &str, has: &str) -> Error {
    let problem = format!("`{name}` is unknown; formulas of {system}: {has}, or give a `file`");
    Error::invalid("policy.formula", problem)
}
