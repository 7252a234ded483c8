//! Plants that are written in Rust: their formulas compiled for vectors.

use std::cell::Cell;
use std::fmt;

use super::{Block, Frame, GRANULE, NativeFormula, NativeSystem};
use crate::policy::Policy;
use crate::real::Vector;
use crate::real::simd::{Formulas, Instructions};
use crate::system::System;

/// A system as compiled.
pub(crate) struct CompiledSystem<S, const NX: usize, const NU: usize>(pub(crate) S);

impl<S, const NX: usize, const NU: usize> fmt::Debug for CompiledSystem<S, NX, NU> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "compiled system of {NX} states and {NU} controls")
    }
}

impl<S, const NX: usize, const NU: usize> NativeSystem for CompiledSystem<S, NX, NU>
where
    S: System<NX, NU> + Send,
{
    fn step(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Step::<S, NX, NU> { system: &self.0, frame, lanes });
    }

    fn margins(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Margins::<S, NX, NU> { system: &self.0, frame, lanes });
    }
}

/// A policy as compiled.
pub(crate) struct CompiledPolicy<P, const NX: usize, const NU: usize>(pub(crate) P);

impl<P, const NX: usize, const NU: usize> fmt::Debug for CompiledPolicy<P, NX, NU> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "compiled policy of {NX} states and {NU} controls")
    }
}

impl<P, const NX: usize, const NU: usize> NativeFormula for CompiledPolicy<P, NX, NU>
where
    P: Policy<NX, NU> + Send,
{
    fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Control::<P, NX, NU> { policy: &self.0, frame, lanes });
    }
}

/// The rows of a frame as far as a tile fills them, in blocks.
pub(super) struct Blocks<'a> {
    cells: &'a [Cell<Block>],
    /// Blocks of a row.
    stride: usize,
    /// Blocks of a row that trajectories are in.
    pub(super) length: usize,
}

impl<'a> Blocks<'a> {
    #[inline(always)]
    pub(super) fn new(frame: &'a mut Frame, lanes: usize) -> Self {
        let stride = frame.width() / GRANULE;
        Self { cells: frame.blocks(), stride, length: lanes.div_ceil(GRANULE) }
    }

    /// `R` rows from `first` on. Cut once, so that the loop over the blocks checks no bounds.
    #[inline(always)]
    pub(super) fn rows<const R: usize>(&self, first: usize) -> [&'a [Cell<Block>]; R] {
        let mut rows = [&self.cells[..0]; R];
        for (i, row) in rows.iter_mut().enumerate() {
            *row = &self.cells[(first + i) * self.stride..][..self.length];
        }
        rows
    }
}

/// The vectors of `rows` from number `at` of a block on.
#[inline(always)]
pub(super) fn load<V: Vector, const R: usize>(
    rows: &[&[Cell<Block>]; R],
    block: usize,
    at: usize,
) -> [V; R] {
    let mut vectors = [V::lit(0.0); R];
    for (vector, row) in vectors.iter_mut().zip(rows) {
        *vector = V::load(&row[block].get()[at..]);
    }
    vectors
}

/// Writes `vectors` to `rows` from number `at` of a block on.
#[inline(always)]
pub(super) fn store<V: Vector, const R: usize>(
    vectors: [V; R],
    rows: &[&[Cell<Block>]; R],
    block: usize,
    at: usize,
) {
    for (vector, row) in vectors.into_iter().zip(rows) {
        let mut numbers = row[block].get();
        vector.store(&mut numbers[at..]);
        row[block].set(numbers);
    }
}

/// The policy's formula.
struct Control<'a, P, const NX: usize, const NU: usize> {
    policy: &'a P,
    frame: &'a mut Frame,
    lanes: usize,
}

impl<P: Policy<NX, NU>, const NX: usize, const NU: usize> Formulas for Control<'_, P, NX, NU> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let blocks = Blocks::new(self.frame, self.lanes);
        let (states, controls) = (blocks.rows::<NX>(0), blocks.rows::<NU>(NX));
        for block in 0..blocks.length {
            for at in (0..GRANULE).step_by(V::WIDTH) {
                let x: [V; NX] = load(&states, block, at);
                store(self.policy.control(x), &controls, block, at);
            }
        }
    }
}

/// The system's dynamics.
struct Step<'a, S, const NX: usize, const NU: usize> {
    system: &'a S,
    frame: &'a mut Frame,
    lanes: usize,
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> Formulas for Step<'_, S, NX, NU> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let blocks = Blocks::new(self.frame, self.lanes);
        let (states, controls) = (blocks.rows::<NX>(0), blocks.rows::<NU>(NX));
        for block in 0..blocks.length {
            for at in (0..GRANULE).step_by(V::WIDTH) {
                let x: [V; NX] = load(&states, block, at);
                let u: [V; NU] = load(&controls, block, at);
                store(self.system.step(x, u), &states, block, at);
            }
        }
    }
}

/// The system's margins.
struct Margins<'a, S, const NX: usize, const NU: usize> {
    system: &'a S,
    frame: &'a mut Frame,
    lanes: usize,
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> Formulas for Margins<'_, S, NX, NU> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let [target, _] = self.frame.margins();
        let blocks = Blocks::new(self.frame, self.lanes);
        let (states, margins) = (blocks.rows::<NX>(0), blocks.rows::<2>(target));
        for block in 0..blocks.length {
            for at in (0..GRANULE).step_by(V::WIDTH) {
                let x: [V; NX] = load(&states, block, at);
                let both = [self.system.target(x), self.system.constraint(x)];
                store(both, &margins, block, at);
            }
        }
    }
}
