//! Pairs of rollouts side by side: the farthest pair of each step, and both measures.

use super::dispatch::{Body, Unit};
use super::kernel::Kernel;
use super::load::LoadPairs;
use super::mlp::Packed;
use super::tile::{Driver, Loss, Score, is_finite};
use crate::policy::Policy;
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{DeviationTask, Farthest, HUGE, PairControl, PairMeasure, Plant};
use crate::system::System;

/// Consecutive pairs for one thread; twin: `shaders/deviation.wgsl`.
#[derive(Debug)]
pub(super) struct Deviation<'a, S, P, const NX: usize, const NU: usize> {
    /// System and policy.
    pub(super) plant: Plant<'a, S, P>,
    /// The policy's network, packed for the kernel.
    pub(super) network: Option<&'a Packed>,
    /// The task.
    pub(super) task: &'a DeviationTask<'a, NX>,
    /// Most pairs in lockstep.
    pub(super) width: usize,
    /// Index of the first pair.
    pub(super) first: u64,
    /// The measures, one for each pair.
    pub(super) out: &'a mut [PairMeasure],
}

impl<S, P, const NX: usize, const NU: usize> Unit for Deviation<'_, S, P, NX, NU>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    /// The farthest pair of each step, `[T + 1]`.
    type Output = Vec<Farthest>;

    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Vec<Farthest> {
        let Self { plant, task, width, .. } = self;
        let mut driver = Driver::<S, P, K, N, NU>::new(plant, self.network, kernel, width);
        let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
        let mut pairs = Pairs::<N, NX>::new(width);
        for (tile, out) in self.out.chunks_mut(width).enumerate() {
            let first = self.first + (tile * width) as u64;
            pairs.load(kernel, task, first, out.len());
            for (t, farthest) in farthest.iter_mut().enumerate() {
                if t > 0 {
                    pairs.step(&mut driver, task.control);
                }
                pairs.judge(&driver, task, t, farthest);
            }
            for (out, scores) in out.chunks_mut(N).zip(&pairs.scores) {
                write(scores, out);
            }
        }
        farthest
    }
}

/// A tile of pairs, group by group.
#[derive(Debug)]
struct Pairs<const N: usize, const NX: usize> {
    nominal: Vec<[Lanes<N>; NX]>,
    perturbed: Vec<[Lanes<N>; NX]>,
    /// Of the nominal and of the perturbed rollouts.
    scores: Vec<[Score<N>; 2]>,
    first: u64,
    count: usize,
}

impl<const N: usize, const NX: usize> Pairs<N, NX> {
    /// Room for `width` pairs.
    fn new(width: usize) -> Self {
        let groups = width.div_ceil(N);
        Self {
            nominal: vec![[Lanes([0.0; N]); NX]; groups],
            perturbed: vec![[Lanes([0.0; N]); NX]; groups],
            scores: vec![[Score::new(); 2]; groups],
            first: 0,
            count: 0,
        }
    }

    /// Takes the pairs `first..first + count` in.
    fn load<K: Kernel>(
        &mut self,
        kernel: K,
        task: &DeviationTask<'_, NX>,
        first: u64,
        count: usize,
    ) {
        (self.first, self.count) = (first, count);
        let groups = self.nominal.iter_mut().zip(&mut self.perturbed);
        for (group, (nominal, perturbed)) in groups.take(count.div_ceil(N)).enumerate() {
            kernel.call(LoadPairs {
                pairs: &task.pairs,
                first: first + (group * N) as u64,
                nominal,
                perturbed,
            });
        }
        self.scores.fill([Score::new(); 2]);
    }

    /// Moves both rollouts of each pair one step on.
    fn step<S, P, K, const NU: usize>(
        &mut self,
        driver: &mut Driver<'_, S, P, K, N, NU>,
        control: PairControl,
    ) where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
        K: Kernel,
    {
        let groups = self.count.div_ceil(N);
        let (nominal, perturbed) = (&mut self.nominal[..groups], &mut self.perturbed[..groups]);
        driver.decide(nominal, self.count);
        driver.step(nominal);
        match control {
            PairControl::Replay => {}
            PairControl::ClosedLoop => driver.decide(perturbed, self.count),
        }
        driver.step(perturbed);
    }

    /// Adds the states of step `t` to the scores, and their distances to the farthest.
    fn judge<S, P, K, const NU: usize>(
        &mut self,
        driver: &Driver<'_, S, P, K, N, NU>,
        task: &DeviationTask<'_, NX>,
        t: usize,
        farthest: &mut Farthest,
    ) where
        S: System<NX, NU>,
        K: Kernel,
    {
        let (loss, gamma) = (Loss::at(task.tightening, t), task.spec.gamma);
        let states = self.nominal.iter().zip(&self.perturbed);
        let groups = self.scores.iter_mut().zip(states);
        for (group, (scores, (x, y))) in groups.take(self.count.div_ceil(N)).enumerate() {
            let [nominal, perturbed] = scores;
            driver.judge(x, nominal, &loss, gamma);
            driver.judge(y, perturbed, &Loss::NONE, gamma);
            let live = N.min(self.count - group * N);
            let first = self.first + (group * N) as u64;
            driver.kernel().call(Gap { x, y, live, first, farthest });
        }
    }
}

/// Writes the measures of the first pairs of a group.
fn write<const N: usize>([nominal, perturbed]: &[Score<N>; 2], out: &mut [PairMeasure]) {
    let (nominal, perturbed) = (nominal.measure().0, perturbed.measure().0);
    for (out, (nominal, perturbed)) in out.iter_mut().zip(nominal.into_iter().zip(perturbed)) {
        *out = PairMeasure { nominal, perturbed };
    }
}

/// Merges the distances of a group of pairs into the farthest.
struct Gap<'a, const N: usize, const NX: usize> {
    x: &'a [Lanes<N>; NX],
    y: &'a [Lanes<N>; NX],
    /// How many of the pairs there are.
    live: usize,
    /// Index of the first of them.
    first: u64,
    farthest: &'a mut Farthest,
}

impl<const N: usize, const NX: usize> Body for Gap<'_, N, NX> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut square = Lanes::<N>::lit(0.0);
        for (x, y) in self.x.iter().zip(self.y) {
            let gap = *y - *x;
            square = square + gap * gap;
        }
        let root = square.sqrt().0;
        let distances = per_lane!(N, i => if is_finite(root[i]) { root[i] } else { HUGE });
        // Distances are not negative, so the order of their bits is theirs.
        let bits = per_lane!(N, i => if i < self.live { distances[i].to_bits() } else { 0 });
        let distance = f32::from_bits(bits.iter().fold(0, |largest, bits| *bits.max(&largest)));
        if distance > self.farthest.distance || self.farthest.pair > self.first {
            let lane = distances.iter().take_while(|d| **d != distance).count();
            *self.farthest =
                self.farthest.merge(Farthest { distance, pair: self.first + lane as u64 });
        }
    }
}
