//! Signs of reach-avoid measures: a decided trajectory leaves the tile, and the next start takes
//! its lane.

use std::array::from_fn;

use super::kernel::Kernel;
use super::reach_avoid::ReachAvoid;
use super::tile::{Driver, Loss, Score};
use crate::policy::Policy;
use crate::real::{Lanes, Real};
use crate::rollout::{NON_FINITE, Plant, ReachAvoidTask};
use crate::system::System;

/// The signs of the unit's measures.
///
/// Each lane has a clock of its own, so the tile stays full until no start is left, and then
/// shrinks. A trajectory does not see which lane it is in.
#[inline(always)]
pub(super) fn signs<S, P, K, const N: usize, const NX: usize, const NU: usize>(
    unit: ReachAvoid<'_, S, P, NX, NU>,
    mut driver: Driver<'_, S, P, K, N, NU>,
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
    K: Kernel,
{
    let Plant { system, .. } = unit.plant;
    let mut queue = Queue::<N, NX>::new(unit.task, unit.first, unit.out.len());
    let mut x = vec![[Lanes([0.0; N]); NX]; unit.width.div_ceil(N)];
    let mut groups = vec![Group::<N>::new(); x.len()];
    let mut live = 0;
    loop {
        while live < unit.width && queue.fill(system, unit.out) {
            queue.waiting -= 1;
            let (to, lane) = (live / N, queue.waiting);
            copy_lane(&mut x[to], live % N, &queue.x, lane);
            groups[to].copy_lane(live % N, &queue.group, lane);
            live += 1;
        }
        if live == 0 {
            return;
        }
        driver.decide(&x[..live.div_ceil(N)], live);
        for (index, (x, group)) in x.iter_mut().zip(&mut groups).enumerate() {
            if index * N < live {
                driver.step(index, x);
                group.advance(system, x, unit.task);
            }
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
    #[inline(always)]
    fn new() -> Self {
        Self {
            score: Score::new(),
            step: [0; N],
            place: [0; N],
            done: [0; N],
        }
    }

    /// Adds the states after one more step.
    #[inline(always)]
    fn advance<S: System<NX, NU>, const NX: usize, const NU: usize>(
        &mut self,
        system: &S,
        x: &[Lanes<N>; NX],
        task: &ReachAvoidTask<'_, NX>,
    ) {
        let horizon = task.spec.horizon;
        // An empty lane runs on: its clock must stay within the tightening.
        self.step = self.step.map(|step| (step + 1).min(horizon));
        let loss = Loss::at_each(task.tightening, &self.step);
        self.score.add(system, x, loss, &task.spec);
        let decided = self.score.decided();
        self.done = from_fn(|i| decided[i] | u32::from(self.step[i] == horizon));
    }

    /// The sign of each measure, [`NON_FINITE`] as it is.
    #[inline(always)]
    fn signs(&self) -> [f32; N] {
        self.score.measure().0.map(sign)
    }

    #[inline(always)]
    fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.score.copy_lane(to, &source.score, from);
        self.step[to] = source.step[from];
        self.place[to] = source.place[from];
        self.done[to] = source.done[from];
    }
}

/// 1 or -1, or [`NON_FINITE`] as it is.
#[inline(always)]
fn sign(measure: f32) -> f32 {
    if measure > 0.0 {
        1.0
    } else if measure == NON_FINITE {
        NON_FINITE
    } else {
        -1.0
    }
}

#[inline(always)]
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
#[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
    fn fill<S: System<NX, NU>, const NU: usize>(&mut self, system: &S, out: &mut [f32]) -> bool {
        while self.waiting == 0 {
            if self.loaded == self.count {
                return false;
            }
            let live = N.min(self.count - self.loaded);
            self.x = self.task.starts.load(self.first + self.loaded as u64);
            self.group = Group::new();
            self.group.place = from_fn(|i| (self.loaded + i) as u32);
            let loss = Loss::at(self.task.tightening, 0);
            self.group.score.add(system, &self.x, loss, &self.task.spec);
            self.group.done = self.group.score.decided();
            self.loaded += live;
            let (x, group) = (
                std::slice::from_mut(&mut self.x),
                std::slice::from_mut(&mut self.group),
            );
            self.waiting = retire(x, group, live, out);
        }
        true
    }
}
