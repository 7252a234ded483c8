//! Code that was compiled together with formulas, for as long as these are what they were.

use std::sync::Arc;

use crate::formula::Graph;

/// Code, and the formulas and values of parameters that it computes.
///
/// Models are data that may be changed: a formula is replaced, a parameter gets another value. Code
/// knows nothing of it, so it stands in for its formulas only while they are the ones it came with.
#[derive(Debug)]
pub(crate) struct CompiledForm<T: ?Sized> {
    code: Arc<T>,
    formulas: Vec<Graph>,
    values: Vec<f32>,
}

impl<T: ?Sized> CompiledForm<T> {
    /// `code` that computes `formulas` where the parameters have `values`.
    pub(super) fn new(code: Arc<T>, formulas: &[&Graph], values: Vec<f32>) -> Arc<Self> {
        let formulas = formulas.iter().copied().cloned().collect();
        Arc::new(Self { code, formulas, values })
    }

    /// The code, if it computes `formulas` where the parameters have `values`.
    pub(super) fn of(&self, formulas: &[&Graph], values: &[f32]) -> Option<&Arc<T>> {
        let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let same = self.formulas.iter().eq(formulas.iter().copied());
        (same && bits(&self.values) == bits(values)).then_some(&self.code)
    }
}
