//! Pairs of rollouts side by side: the farthest pair of each step, and both measures.

use super::dispatch::Body;
use super::kernel::Kernel;
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

impl<S, P, const NX: usize, const NU: usize> Body for Deviation<'_, S, P, NX, NU>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    /// The farthest pair of each step, `[T + 1]`.
    type Output = Vec<Farthest>;

    #[inline(always)]
    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Vec<Farthest> {
        let Self {
            plant, task, width, ..
        } = self;
        let mut driver = Driver::<S, P, K, N, NU>::new(plant, self.network, kernel, width);
        let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
        let mut pairs = Pairs::<N, NX>::new(width);
        for (tile, out) in self.out.chunks_mut(width).enumerate() {
            let first = self.first + (tile * width) as u64;
            pairs.load(task, first, out.len());
            for (t, farthest) in farthest.iter_mut().enumerate() {
                if t > 0 {
                    pairs.step(&mut driver, task.control);
                }
                pairs.judge(plant.system, task, t, farthest);
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
    #[inline(always)]
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
    #[inline(always)]
    fn load(&mut self, task: &DeviationTask<'_, NX>, first: u64, count: usize) {
        (self.first, self.count) = (first, count);
        let groups = self.nominal.iter_mut().zip(&mut self.perturbed);
        for (group, (nominal, perturbed)) in groups.take(count.div_ceil(N)).enumerate() {
            [*nominal, *perturbed] = task.pairs.load(first + (group * N) as u64);
        }
        self.scores.fill([Score::new(); 2]);
    }

    /// Moves both rollouts of each pair one step on.
    #[inline(always)]
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
        driver.step_all(nominal);
        match control {
            PairControl::Replay => {}
            PairControl::ClosedLoop => driver.decide(perturbed, self.count),
        }
        driver.step_all(perturbed);
    }

    /// Adds the states of step `t` to the scores, and their distances to the farthest.
    #[inline(always)]
    fn judge<S: System<NX, NU>, const NU: usize>(
        &mut self,
        system: &S,
        task: &DeviationTask<'_, NX>,
        t: usize,
        farthest: &mut Farthest,
    ) {
        let loss = Loss::at(task.tightening, t);
        let states = self.nominal.iter().zip(&self.perturbed);
        let groups = self.scores.iter_mut().zip(states);
        for (group, (scores, (x, y))) in groups.take(self.count.div_ceil(N)).enumerate() {
            let [nominal, perturbed] = scores;
            nominal.add(system, x, loss, &task.spec);
            perturbed.add(system, y, Loss::NONE, &task.spec);
            let live = N.min(self.count - group * N);
            let first = self.first + (group * N) as u64;
            farther(farthest, &distance(x, y).0[..live], first);
        }
    }
}

/// Writes the measures of the first pairs of a group.
#[inline(always)]
fn write<const N: usize>([nominal, perturbed]: &[Score<N>; 2], out: &mut [PairMeasure]) {
    let (nominal, perturbed) = (nominal.measure().0, perturbed.measure().0);
    for (out, (nominal, perturbed)) in out.iter_mut().zip(nominal.into_iter().zip(perturbed)) {
        *out = PairMeasure { nominal, perturbed };
    }
}

/// Euclidean distance of two groups of states; [`HUGE`] where one is not finite.
#[inline(always)]
fn distance<const N: usize, const NX: usize>(x: &[Lanes<N>; NX], y: &[Lanes<N>; NX]) -> Lanes<N> {
    let mut square = Lanes::<N>::lit(0.0);
    for (x, y) in x.iter().zip(y) {
        let gap = *y - *x;
        square = square + gap * gap;
    }
    let distance = square.sqrt();
    Lanes(per_lane!(N, i => {
        if is_finite(distance.0[i]) {
            distance.0[i]
        } else {
            HUGE
        }
    }))
}

/// Merges the distances of the pairs from `first` on into `farthest`.
#[inline(always)]
fn farther(farthest: &mut Farthest, distances: &[f32], first: u64) {
    // Distances are not negative, so the order of their bits is theirs.
    let largest = distances
        .iter()
        .fold(0, |largest, d| d.to_bits().max(largest));
    let distance = f32::from_bits(largest);
    if distance > farthest.distance || farthest.pair > first {
        let lane = distances.iter().take_while(|d| **d != distance).count();
        *farthest = farthest.merge(Farthest {
            distance,
            pair: first + lane as u64,
        });
    }
}
