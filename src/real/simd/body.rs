//! Work that is compiled for each instruction set by itself.

use crate::real::Vector;

/// Work on one group of lanes, compiled for each instruction set by itself.
///
/// Small and few: every body is compiled for every set.
pub(crate) trait Body {
    /// What it returns.
    type Output;

    /// Does the work. Must be `#[inline(always)]`, as all that it calls, or it is compiled for
    /// the baseline instructions.
    fn run(self) -> Self::Output;
}

/// Formulas over the vectors of an instruction set.
pub(crate) trait Formulas {
    /// Does the work. Must be `#[inline(always)]`, as for [`Body`].
    fn run<V: Vector>(self);
}

/// One instruction set, and what is compiled for it; a value is the proof that the processor has it.
pub(crate) trait Simd: Copy + Send + Sync {
    /// What its bodies evaluate formulas in.
    type Vector: Vector;

    /// Calls `body`, compiled for these instructions.
    fn call<B: Body>(self, body: B) -> B::Output;
}
