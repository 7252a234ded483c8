//! A tile of trajectories in groups of lanes: their controls and their scores.

use std::marker::PhantomData;

use super::dispatch::Body;
use super::kernel::Kernel;
use super::mlp::{Evaluator, Packed};
use crate::policy::Policy;
use crate::real::{Lanes, Real, Vector, load_rows, per_lane, store_rows};
use crate::rollout::{Fold, HUGE, NON_FINITE, Plant, Tightening};
use crate::system::System;

/// Exponent bits of an f32: all set for infinities and NaN.
const EXPONENT: u32 = 0x7f80_0000;

/// Whether `value` is neither infinite nor NaN, by its exponent bits: a compiler may remove
/// `x != x`.
#[inline(always)]
pub(super) fn is_finite(value: f32) -> bool {
    value.to_bits() & EXPONENT != EXPONENT
}

/// A plant with room for the controls of a tile.
#[derive(Debug)]
pub(super) struct Driver<'a, S, P, K, const N: usize, const NU: usize> {
    plant: Plant<'a, S, P>,
    network: Option<Evaluator<'a, K>>,
    kernel: K,
    controls: Vec<[Lanes<N>; NU]>,
}

impl<'a, S, P, K: Kernel, const N: usize, const NU: usize> Driver<'a, S, P, K, N, NU> {
    /// For tiles of up to `lanes` trajectories; the policy's network packed, if it is one.
    pub(super) fn new(
        plant: Plant<'a, S, P>,
        network: Option<&'a Packed>,
        kernel: K,
        lanes: usize,
    ) -> Self {
        Self {
            plant,
            network: network.map(|network| Evaluator::new(network, kernel, lanes)),
            kernel,
            controls: vec![[Lanes([0.0; N]); NU]; lanes.div_ceil(N)],
        }
    }

    /// Evaluates the policy at the first `lanes` states of the groups `x`.
    pub(super) fn decide<const NX: usize>(&mut self, x: &[[Lanes<N>; NX]], lanes: usize)
    where
        P: Policy<NX, NU>,
    {
        if let Some(network) = &mut self.network {
            network.forward(x, lanes, &mut self.controls);
            return;
        }
        let policy = self.plant.policy;
        for (u, x) in self.controls.iter_mut().zip(x) {
            self.kernel.call(Control::<P, K, N, NX, NU> { kernel: PhantomData, policy, x, u });
        }
    }

    /// Moves the states of the groups one step on, by the controls decided last.
    pub(super) fn step<const NX: usize>(&self, x: &mut [[Lanes<N>; NX]])
    where
        S: System<NX, NU>,
    {
        let system = self.plant.system;
        for (x, u) in x.iter_mut().zip(&self.controls) {
            self.kernel.call(Step::<S, K, N, NX, NU> { kernel: PhantomData, system, x, u });
        }
    }

    /// Adds the states `x` of a group to its scores.
    pub(super) fn judge<const NX: usize>(
        &self,
        x: &[Lanes<N>; NX],
        score: &mut Score<N>,
        loss: &Loss<N>,
        gamma: f32,
    ) where
        S: System<NX, NU>,
    {
        self.kernel.call(Judge::<S, K, N, NX, NU> {
            kernel: PhantomData,
            system: self.plant.system,
            x,
            score,
            loss,
            gamma,
        });
    }

    /// The kernel, for other bodies.
    pub(super) fn kernel(&self) -> K {
        self.kernel
    }
}

/// The policy's formula for a group.
struct Control<'a, P, K, const N: usize, const NX: usize, const NU: usize> {
    kernel: PhantomData<K>,
    policy: &'a P,
    x: &'a [Lanes<N>; NX],
    u: &'a mut [Lanes<N>; NU],
}

impl<P, K, const N: usize, const NX: usize, const NU: usize> Body for Control<'_, P, K, N, NX, NU>
where
    P: Policy<NX, NU>,
    K: Kernel,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for at in (0..N).step_by(K::Vector::WIDTH) {
            let x: [K::Vector; NX] = load_rows(self.x, at);
            store_rows(self.policy.control(x), self.u, at);
        }
    }
}

/// The system's dynamics for a group.
struct Step<'a, S, K, const N: usize, const NX: usize, const NU: usize> {
    kernel: PhantomData<K>,
    system: &'a S,
    x: &'a mut [Lanes<N>; NX],
    u: &'a [Lanes<N>; NU],
}

impl<S, K, const N: usize, const NX: usize, const NU: usize> Body for Step<'_, S, K, N, NX, NU>
where
    S: System<NX, NU>,
    K: Kernel,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for at in (0..N).step_by(K::Vector::WIDTH) {
            let x: [K::Vector; NX] = load_rows(self.x, at);
            store_rows(self.system.step(x, load_rows(self.u, at)), self.x, at);
        }
    }
}

/// The system's margins for a group, folded.
struct Judge<'a, S, K, const N: usize, const NX: usize, const NU: usize> {
    kernel: PhantomData<K>,
    system: &'a S,
    x: &'a [Lanes<N>; NX],
    score: &'a mut Score<N>,
    loss: &'a Loss<N>,
    gamma: f32,
}

impl<S, K, const N: usize, const NX: usize, const NU: usize> Body for Judge<'_, S, K, N, NX, NU>
where
    S: System<NX, NU>,
    K: Kernel,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut margins = [Lanes([0.0; N]); 2];
        for at in (0..N).step_by(K::Vector::WIDTH) {
            let x: [K::Vector; NX] = load_rows(self.x, at);
            let [target_loss, constraint_loss] = load_rows(&self.loss.0, at);
            let target = self.system.target(x) - target_loss;
            let constraint = self.system.constraint(x) - constraint_loss;
            store_rows([target, constraint], &mut margins, at);
        }
        let [target, constraint] = margins;
        let mut largest = [0; N];
        for values in self.x.iter().chain([&target, &constraint]) {
            largest = per_lane!(N, i => values.0[i].abs().to_bits().max(largest[i]));
        }
        self.score.add(target, constraint, largest, self.gamma);
    }
}

/// What both margins lose, per lane: off the target margin, off the constraint margin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loss<const N: usize>([Lanes<N>; 2]);

impl<const N: usize> Loss<N> {
    /// Nothing.
    pub(super) const NONE: Self = Self([Lanes([0.0; N]); 2]);

    /// At step `t`, the same for all lanes.
    #[inline(always)]
    pub(super) fn at(tightening: &Tightening, t: usize) -> Self {
        let (target, constraint) = (tightening.target[t], tightening.constraint[t]);
        Self([Lanes::lit(target), Lanes::lit(constraint)])
    }

    /// At a step of its own for each lane.
    #[inline(always)]
    pub(super) fn at_each(tightening: &Tightening, steps: &[u32; N]) -> Self {
        let Tightening { target, constraint } = tightening;
        Self([
            Lanes(per_lane!(N, i => target[steps[i] as usize])),
            Lanes(per_lane!(N, i => constraint[steps[i] as usize])),
        ])
    }
}

/// The reach-avoid measures of a group so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score<const N: usize> {
    fold: Fold<Lanes<N>>,
    /// Not 0 where a state or margin was not finite.
    failed: [u32; N],
}

impl<const N: usize> Score<N> {
    /// Before the first state.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { fold: Fold::new(), failed: [0; N] }
    }

    /// Adds the margins of the next states; fails the rollouts where `largest`, the largest bits
    /// without sign of margins and states, belong to no finite number.
    #[inline(always)]
    fn add(&mut self, target: Lanes<N>, constraint: Lanes<N>, largest: [u32; N], gamma: f32) {
        self.failed = per_lane!(N, i => self.failed[i] | u32::from(largest[i] >= EXPONENT));
        // Margins of -HUGE leave a positive measure as it is and make no other one positive.
        let target = lost(&self.failed, target);
        let constraint = lost(&self.failed, constraint);
        self.fold.add(target, constraint, Lanes::lit(gamma));
    }

    /// The measures; [`NON_FINITE`] where the rollout failed before it reached the target.
    #[inline(always)]
    pub(super) fn measure(&self) -> Lanes<N> {
        let measure = self.fold.measure().0;
        Lanes(per_lane!(N, i => {
            if self.failed[i] != 0 && measure[i] <= 0.0 {
                NON_FINITE
            } else {
                measure[i]
            }
        }))
    }

    /// Not 0 where no later state can change the sign of the measure: reached, or unsafe.
    #[inline(always)]
    pub(super) fn decided(&self) -> [u32; N] {
        let (measure, safe) = (self.fold.measure().0, self.fold.safe().0);
        per_lane!(N, i => u32::from(measure[i] > 0.0) | u32::from(safe[i] <= 0.0))
    }

    /// Copies lane `from` of `source` to lane `to`.
    #[inline(always)]
    pub(super) fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.fold.copy_lane(to, &source.fold, from);
        self.failed[to] = source.failed[from];
    }
}

/// `margin`, or -[`HUGE`] where the rollout failed.
#[inline(always)]
fn lost<const N: usize>(failed: &[u32; N], margin: Lanes<N>) -> Lanes<N> {
    Lanes(per_lane!(N, i => if failed[i] != 0 { -HUGE } else { margin.0[i] }))
}
