//! Signs of reach-avoid measures: a decided trajectory leaves the tile, and the next start takes
//! its lane.

use super::kernel::Kernel;
use super::load::LoadStarts;
use super::reach_avoid::ReachAvoid;
use super::tile::{Driver, Loss, Score};
use crate::policy::Policy;
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{NON_FINITE, ReachAvoidTask};
use crate::system::System;

/// The signs of the unit's measures.
///
/// Each lane has a clock of its own, so the tile stays full until no start is left, and then
/// shrinks. A trajectory does not see which lane it is in.
pub(super) fn signs<S, P, K, const N: usize, const NX: usize, const NU: usize>(
    unit: ReachAvoid<'_, S, P, NX, NU>,
    mut driver: Driver<'_, S, P, K, N, NU>,
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
    K: Kernel,
{
    let mut queue = Queue::<N, NX>::new(unit.task, unit.first, unit.out.len());
    let mut x = vec![[Lanes([0.0; N]); NX]; unit.width.div_ceil(N)];
    let mut groups = vec![Group::<N>::new(); x.len()];
    let mut live = 0;
    loop {
        while live < unit.width && queue.fill(&driver, unit.out) {
            queue.waiting -= 1;
            let (to, lane) = (live / N, queue.waiting);
            copy_lane(&mut x[to], live % N, &queue.x, lane);
            groups[to].copy_lane(live % N, &queue.group, lane);
            live += 1;
        }
        if live == 0 {
            return;
        }
        let active = &mut x[..live.div_ceil(N)];
        driver.decide(active, live);
        driver.step(active);
        for (x, group) in active.iter().zip(&mut groups) {
            group.tick(unit.task.spec.horizon);
            group.judge(&driver, x, unit.task);
        }
        live = retire(&mut x, &mut groups, live, unit.out);
    }
}

/// What is known of the trajectories of a group besides their states.
#[derive(Clone, Copy, Debug)]
struct Group<const N: usize> {
    score: Score<N>,
    /// Steps taken.
    step: [u32; N],
    /// Place of the result.
    place: [u32; N],
    /// Not 0 where the sign is known.
    done: [u32; N],
}

impl<const N: usize> Group<N> {
    fn new() -> Self {
        Self { score: Score::new(), step: [0; N], place: [0; N], done: [0; N] }
    }

    /// Counts a step.
    fn tick(&mut self, horizon: u32) {
        // An empty lane runs on: its clock must stay within the tightening.
        self.step = per_lane!(N, i => (self.step[i] + 1).min(horizon));
    }

    /// Adds the states `x`.
    fn judge<S, P, K, const NX: usize, const NU: usize>(
        &mut self,
        driver: &Driver<'_, S, P, K, N, NU>,
        x: &[Lanes<N>; NX],
        task: &ReachAvoidTask<'_, NX>,
    ) where
        S: System<NX, NU>,
        K: Kernel,
    {
        let loss = Loss::at_each(task.tightening, &self.step);
        driver.judge(x, &mut self.score, &loss, task.spec.gamma);
        let (decided, horizon) = (self.score.decided(), task.spec.horizon);
        self.done = per_lane!(N, i => decided[i] | u32::from(self.step[i] == horizon));
    }

    /// The sign of each measure, [`NON_FINITE`] as it is.
    fn signs(&self) -> [f32; N] {
        let measure = self.score.measure().0;
        per_lane!(N, i => sign(measure[i]))
    }

    fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.score.copy_lane(to, &source.score, from);
        self.step[to] = source.step[from];
        self.place[to] = source.place[from];
        self.done[to] = source.done[from];
    }
}

/// 1 or -1, or [`NON_FINITE`] as it is.
fn sign(measure: f32) -> f32 {
    if measure > 0.0 {
        1.0
    } else if measure == NON_FINITE {
        NON_FINITE
    } else {
        -1.0
    }
}

fn copy_lane<const N: usize, const NX: usize>(
    x: &mut [Lanes<N>; NX],
    to: usize,
    source: &[Lanes<N>; NX],
    from: usize,
) {
    for (x, source) in x.iter_mut().zip(source) {
        x.0[to] = source.0[from];
    }
}

/// Writes the results of decided trajectories and closes the gaps; returns how many are left.
fn retire<const N: usize, const NX: usize>(
    x: &mut [[Lanes<N>; NX]],
    groups: &mut [Group<N>],
    mut live: usize,
    out: &mut [f32],
) -> usize {
    // From the end, so that the trajectory which fills a gap has been looked at.
    for index in (0..live.div_ceil(N)).rev() {
        if groups[index].done.iter().all(|done| *done == 0) {
            continue;
        }
        let signs = groups[index].signs();
        for lane in (0..N.min(live - index * N)).rev() {
            if groups[index].done[lane] == 0 {
                continue;
            }
            out[groups[index].place[lane] as usize] = signs[lane];
            live -= 1;
            let (last, from) = (live / N, live % N);
            let (moved, states) = (groups[last], x[last]);
            groups[index].copy_lane(lane, &moved, from);
            copy_lane(&mut x[index], lane, &states, from);
        }
    }
    live
}

/// The next starts, judged at their first state: many are decided before any step.
#[derive(Debug)]
struct Queue<'a, const N: usize, const NX: usize> {
    task: &'a ReachAvoidTask<'a, NX>,
    first: u64,
    count: usize,
    /// Starts loaded so far.
    loaded: usize,
    x: [Lanes<N>; NX],
    group: Group<N>,
    /// The first so many lanes wait for a place in the tile.
    waiting: usize,
}

impl<'a, const N: usize, const NX: usize> Queue<'a, N, NX> {
    fn new(task: &'a ReachAvoidTask<'a, NX>, first: u64, count: usize) -> Self {
        Self {
            task,
            first,
            count,
            loaded: 0,
            x: [Lanes::lit(0.0); NX],
            group: Group::new(),
            waiting: 0,
        }
    }

    /// Loads starts until one waits; false if none is left.
    fn fill<S, P, K, const NU: usize>(
        &mut self,
        driver: &Driver<'_, S, P, K, N, NU>,
        out: &mut [f32],
    ) -> bool
    where
        S: System<NX, NU>,
        K: Kernel,
    {
        while self.waiting == 0 {
            if self.loaded == self.count {
                return false;
            }
            let live = N.min(self.count - self.loaded);
            driver.kernel().call(LoadStarts {
                starts: &self.task.starts,
                first: self.first + self.loaded as u64,
                x: &mut self.x,
            });
            self.group = Group::new();
            self.group.place = per_lane!(N, i => (self.loaded + i) as u32);
            self.group.judge(driver, &self.x, self.task);
            self.loaded += live;
            let (x, group) =
                (std::slice::from_mut(&mut self.x), std::slice::from_mut(&mut self.group));
            self.waiting = retire(x, group, live, out);
        }
        true
    }
}
