//! Pairs of rollouts side by side: the farthest pair of each step, and both measures.

use std::array::from_fn;

use super::dispatch::Body;
use super::kernel::Kernel;
use super::mlp::Packed;
use super::tile::{Driver, Loss, Score, is_finite};
use crate::policy::Policy;
use crate::real::{Lanes, Real};
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

/// A group of pairs: of each the nominal, then the perturbed rollout.
#[derive(Clone, Copy, Debug)]
struct Scores<const N: usize> {
    nominal: Score<N>,
    perturbed: Score<N>,
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
            plant: Plant { system, .. },
            task,
            width,
            ..
        } = self;
        let horizon = task.spec.horizon as usize;
        let mut driver = Driver::<S, P, K, N, NU>::new(self.plant, self.network, kernel, width);
        let mut farthest = vec![Farthest::NONE; horizon + 1];
        let mut nominal = vec![[Lanes([0.0; N]); NX]; width.div_ceil(N)];
        let mut perturbed = nominal.clone();
        let mut scores = vec![Scores::<N>::new(); nominal.len()];
        for (tile, out) in self.out.chunks_mut(width).enumerate() {
            let first = self.first + (tile * width) as u64;
            let pairs = out.len();
            let groups = pairs.div_ceil(N);
            let (nominal, perturbed) = (&mut nominal[..groups], &mut perturbed[..groups]);
            for (group, x) in nominal.iter_mut().enumerate() {
                [*x, perturbed[group]] = task.pairs.load(first + (group * N) as u64);
            }
            scores.fill(Scores::new());
            for t in 0..=horizon {
                if t > 0 {
                    driver.decide(nominal, pairs);
                    driver.step_all(nominal);
                    if task.control == PairControl::ClosedLoop {
                        driver.decide(perturbed, pairs);
                    }
                    driver.step_all(perturbed);
                }
                let loss = Loss::at(task.tightening, t);
                for (group, scores) in scores[..groups].iter_mut().enumerate() {
                    let (x, y) = (&nominal[group], &perturbed[group]);
                    scores.nominal.add(system, x, loss, &task.spec);
                    scores.perturbed.add(system, y, Loss::NONE, &task.spec);
                    let live = N.min(pairs - group * N);
                    let index = first + (group * N) as u64;
                    farther(&mut farthest[t], &distance(x, y).0[..live], index);
                }
            }
            for (out, scores) in out.chunks_mut(N).zip(&scores) {
                scores.write(out);
            }
        }
        farthest
    }
}

impl<const N: usize> Scores<N> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            nominal: Score::new(),
            perturbed: Score::new(),
        }
    }

    /// The measures of the first pairs of the group.
    #[inline(always)]
    fn write(&self, out: &mut [PairMeasure]) {
        let (nominal, perturbed) = (self.nominal.measure().0, self.perturbed.measure().0);
        for (out, (nominal, perturbed)) in out.iter_mut().zip(nominal.into_iter().zip(perturbed)) {
            *out = PairMeasure { nominal, perturbed };
        }
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
    Lanes(from_fn(|i| {
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
