//! Plants that are written in Rust: their formulas compiled for vectors.

use std::fmt;
use std::ops::Range;

use super::{Frame, NativeFormula, NativeSystem};
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

/// The vectors of the rows from `rows.start` on, from trajectory `at` on.
#[inline(always)]
fn load<V: Vector, const R: usize>(frame: &Frame, rows: Range<usize>, at: usize) -> [V; R] {
    let (numbers, width) = (&frame.rows()[rows.start * frame.width()..], frame.width());
    let mut vectors = [V::lit(0.0); R];
    for (row, vector) in vectors.iter_mut().enumerate() {
        *vector = V::load(&numbers[row * width + at..]);
    }
    vectors
}

/// Writes `vectors` to the rows from `rows.start` on, from trajectory `at` on.
#[inline(always)]
fn store<V: Vector, const R: usize>(
    vectors: [V; R],
    frame: &mut Frame,
    rows: Range<usize>,
    at: usize,
) {
    let width = frame.width();
    let numbers = &mut frame.rows_mut()[rows.start * width..];
    for (row, vector) in vectors.into_iter().enumerate() {
        vector.store(&mut numbers[row * width + at..]);
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
        let (states, controls) = (self.frame.states(), self.frame.controls());
        for at in (0..self.lanes).step_by(V::WIDTH) {
            let x: [V; NX] = load(self.frame, states.clone(), at);
            store(self.policy.control(x), self.frame, controls.clone(), at);
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
        let (states, controls) = (self.frame.states(), self.frame.controls());
        for at in (0..self.lanes).step_by(V::WIDTH) {
            let x: [V; NX] = load(self.frame, states.clone(), at);
            let u: [V; NU] = load(self.frame, controls.clone(), at);
            store(self.system.step(x, u), self.frame, states.clone(), at);
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
        let (states, [target, _]) = (self.frame.states(), self.frame.margins());
        for at in (0..self.lanes).step_by(V::WIDTH) {
            let x: [V; NX] = load(self.frame, states.clone(), at);
            let margins = [self.system.target(x), self.system.constraint(x)];
            store(margins, self.frame, target..target + 2, at);
        }
    }
}
