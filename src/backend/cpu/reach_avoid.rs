//! Reach-avoid measures of a unit of starts, tile by tile.

use super::dispatch::Body;
use super::early_exit::signs;
use super::kernel::Kernel;
use super::mlp::Packed;
use super::tile::{Driver, Loss, Score};
use crate::policy::Policy;
use crate::real::Lanes;
use crate::rollout::{Plant, Query, ReachAvoidTask};
use crate::system::System;

/// Consecutive starts for one thread; twin: `shaders/reach_avoid.wgsl`.
#[derive(Debug)]
pub(super) struct ReachAvoid<'a, S, P, const NX: usize, const NU: usize> {
    /// System and policy.
    pub(super) plant: Plant<'a, S, P>,
    /// The policy's network, packed for the kernel.
    pub(super) network: Option<&'a Packed>,
    /// The task.
    pub(super) task: &'a ReachAvoidTask<'a, NX>,
    /// Most trajectories in lockstep.
    pub(super) width: usize,
    /// Index of the first start.
    pub(super) first: u64,
    /// The results, one for each start.
    pub(super) out: &'a mut [f32],
}

impl<S, P, const NX: usize, const NU: usize> Body for ReachAvoid<'_, S, P, NX, NU>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        let driver = Driver::<S, P, K, N, NU>::new(self.plant, self.network, kernel, self.width);
        match self.task.query {
            Query::Measure => measures(self, driver),
            Query::Sign => signs(self, driver),
        }
    }
}

/// The measures, by tiles of trajectories that start and end together.
#[inline(always)]
fn measures<S, P, K, const N: usize, const NX: usize, const NU: usize>(
    unit: ReachAvoid<'_, S, P, NX, NU>,
    mut driver: Driver<'_, S, P, K, N, NU>,
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
    K: Kernel,
{
    let ReachAvoid {
        plant: Plant { system, .. },
        task,
        width,
        ..
    } = unit;
    let mut x = vec![[Lanes([0.0; N]); NX]; width.div_ceil(N)];
    let mut scores = vec![Score::<N>::new(); x.len()];
    for (tile, out) in unit.out.chunks_mut(width).enumerate() {
        let groups = out.len().div_ceil(N);
        let (x, scores) = (&mut x[..groups], &mut scores[..groups]);
        for (group, (x, score)) in x.iter_mut().zip(&mut *scores).enumerate() {
            *x = task
                .starts
                .load(unit.first + (tile * width + group * N) as u64);
            *score = Score::new();
            score.add(system, x, Loss::at(task.tightening, 0), &task.spec);
        }
        for t in 1..=task.spec.horizon as usize {
            driver.decide(x, out.len());
            let loss = Loss::at(task.tightening, t);
            for (group, (x, score)) in x.iter_mut().zip(&mut *scores).enumerate() {
                driver.step(group, x);
                score.add(system, x, loss, &task.spec);
            }
        }
        for (out, score) in out.chunks_mut(N).zip(scores) {
            out.copy_from_slice(&score.measure().0[..out.len()]);
        }
    }
}
