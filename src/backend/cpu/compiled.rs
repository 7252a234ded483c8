//! Plants that are written in Rust: their formulas compiled for vectors.

use std::ops::Range;

use super::dispatch::{Formulas, Instructions};
use super::frame::Frame;
use super::physics::Physics;
use crate::policy::Policy;
use crate::real::Vector;
use crate::rollout::Plant;
use crate::system::System;

/// A system and its policy as compiled.
#[derive(Debug)]
pub(super) struct Compiled<'a, S, P, const NX: usize, const NU: usize>(pub(super) Plant<'a, S, P>);

impl<S, P, const NX: usize, const NU: usize> Physics for Compiled<'_, S, P, NX, NU>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    fn size(&self) -> [usize; 2] {
        [NX, NU]
    }

    fn control(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Control::<P, NX, NU> { policy: self.0.policy, frame, lanes });
    }

    fn step(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Step::<S, NX, NU> { system: self.0.system, frame, lanes });
    }

    fn margins(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Margins::<S, NX, NU> { system: self.0.system, frame, lanes });
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
