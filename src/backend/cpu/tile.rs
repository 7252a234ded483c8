//! A tile of trajectories in groups of lanes: their controls and their scores.

use std::array::from_fn;

use super::kernel::Kernel;
use super::mlp::{Evaluator, Packed};
use crate::policy::Policy;
use crate::real::{Lanes, Real};
use crate::rollout::{Fold, HUGE, NON_FINITE, Plant, RolloutSpec, Tightening};
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
            controls: vec![[Lanes([0.0; N]); NU]; lanes.div_ceil(N)],
        }
    }

    /// Evaluates the policy at the first `lanes` states of the groups `x`.
    #[inline(always)]
    pub(super) fn decide<const NX: usize>(&mut self, x: &[[Lanes<N>; NX]], lanes: usize)
    where
        P: Policy<NX, NU>,
    {
        match &mut self.network {
            Some(network) => network.forward(x, lanes, &mut self.controls),
            None => {
                for (u, x) in self.controls.iter_mut().zip(x) {
                    *u = self.plant.policy.control(*x);
                }
            }
        }
    }

    /// Moves the states of a group one step on, by the controls decided last.
    #[inline(always)]
    pub(super) fn step<const NX: usize>(&self, group: usize, x: &mut [Lanes<N>; NX])
    where
        S: System<NX, NU>,
    {
        *x = self.plant.system.step(*x, self.controls[group]);
    }

    /// The same for all groups of a tile.
    #[inline(always)]
    pub(super) fn step_all<const NX: usize>(&self, x: &mut [[Lanes<N>; NX]])
    where
        S: System<NX, NU>,
    {
        for (group, x) in x.iter_mut().enumerate() {
            self.step(group, x);
        }
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
        Self([tightening.target[t], tightening.constraint[t]].map(Lanes::lit))
    }

    /// At a step of its own for each lane.
    #[inline(always)]
    pub(super) fn at_each(tightening: &Tightening, steps: &[u32; N]) -> Self {
        let gather = |values: &[f32]| Lanes(from_fn(|i| values[steps[i] as usize]));
        Self([gather(&tightening.target), gather(&tightening.constraint)])
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
        Self {
            fold: Fold::new(),
            failed: [0; N],
        }
    }

    /// Adds the states `x`; one that is not finite fails its rollout from there on.
    #[inline(always)]
    pub(super) fn add<S: System<NX, NU>, const NX: usize, const NU: usize>(
        &mut self,
        system: &S,
        x: &[Lanes<N>; NX],
        Loss([target_loss, constraint_loss]): Loss<N>,
        spec: &RolloutSpec,
    ) {
        let target = system.target(*x) - target_loss;
        let constraint = system.constraint(*x) - constraint_loss;
        let mut largest = [0; N];
        for values in x.iter().chain([&target, &constraint]) {
            largest = from_fn(|i| values.0[i].abs().to_bits().max(largest[i]));
        }
        self.failed = from_fn(|i| self.failed[i] | u32::from(largest[i] >= EXPONENT));
        // Margins of -HUGE leave a positive measure as it is and make no other one positive.
        let failed = self.failed;
        let or_lost = |margin: Lanes<N>| {
            Lanes(from_fn(
                |i| if failed[i] != 0 { -HUGE } else { margin.0[i] },
            ))
        };
        self.fold
            .add(or_lost(target), or_lost(constraint), Lanes::lit(spec.gamma));
    }

    /// The measures; [`NON_FINITE`] where the rollout failed before it reached the target.
    #[inline(always)]
    pub(super) fn measure(&self) -> Lanes<N> {
        let measure = self.fold.measure().0;
        Lanes(from_fn(|i| {
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
        from_fn(|i| u32::from(measure[i] > 0.0) | u32::from(safe[i] <= 0.0))
    }

    /// Copies lane `from` of `source` to lane `to`.
    #[inline(always)]
    pub(super) fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.fold.copy_lane(to, &source.fold, from);
        self.failed[to] = source.failed[from];
    }
}
