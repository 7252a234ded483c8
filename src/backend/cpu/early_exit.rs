//! Signs of reach-avoid measures: a decided trajectory leaves the tile, and the next start takes
//! its lane.

use super::dispatch::Unit;
use super::kernel::Kernel;
use super::load::Loader;
use super::reach_avoid::{ReachAvoid, measures};
use super::rule::{Roles, Rule};
use super::tile::{Score, TileRunner};
use crate::model::Moment;
use crate::real::per_lane;
use crate::rollout::{NON_FINITE, Query, ReachAvoidTask};
use crate::tile::Frame;

impl Unit for ReachAvoid<'_> {
    type Output = ();

    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        let runner = TileRunner::new(self.plant, kernel, self.width);
        match self.task.query {
            Query::Measure => measures::<K, N>(self, runner),
            Query::Sign => signs::<K, N>(self, runner),
        }
    }
}

/// The signs of the unit's measures.
///
/// Each lane has a clock of its own, so the tile stays full until no start is left, and then
/// shrinks. A trajectory does not see which lane it is in. All of a tile are at the same point of their
/// periods: starts come in between two periods.
pub(super) fn signs<K: Kernel, const N: usize>(
    unit: ReachAvoid<'_>,
    mut runner: TileRunner<'_, K>,
) {
    let mut queue = Queue::<K, N>::new(&unit, &runner);
    let mut frame = runner.frame();
    let mut groups = vec![Group::<N>::new(); unit.width.div_ceil(N)];
    let mut live = 0;
    loop {
        while live < unit.width && queue.fill(&runner, unit.out) {
            queue.waiting -= 1;
            frame.copy_lane(live, &queue.frame, queue.waiting);
            groups[live / N].copy_lane(live % N, &queue.group, queue.waiting);
            live += 1;
        }
        if live == 0 {
            return;
        }
        say_when(&runner, &mut frame, &groups, 0);
        runner.decide(&mut frame, live);
        for point in 1..runner.points() {
            runner.step(&mut frame, live);
            judge(&runner, &mut frame, &mut groups, live, Asked::of(&unit, point));
            live = retire(&mut frame, &mut groups, live, unit.out);
            say_when(&runner, &mut frame, &groups, point);
        }
        runner.step(&mut frame, live);
        groups.iter_mut().for_each(|group| group.tick(unit.task.spec.horizon));
        judge(&runner, &mut frame, &mut groups, live, Asked::of(&unit, 0));
        live = retire(&mut frame, &mut groups, live, unit.out);
    }
}

/// Says of which moment each state of a tile is; those that have changed lanes bring theirs along.
fn say_when<K: Kernel, const N: usize>(
    runner: &TileRunner<'_, K>,
    frame: &mut Frame,
    groups: &[Group<N>],
    point: u32,
) {
    let steps = groups.iter().flat_map(|group| group.step);
    runner.at_each(frame, steps.map(|step| Moment { step, point }));
}

/// What states are judged by.
#[derive(Clone, Copy)]
struct Asked<'a> {
    task: &'a ReachAvoidTask<'a>,
    roles: &'a Roles,
    /// Number of the point of their periods; 0 at samples.
    point: u32,
}

impl<'a> Asked<'a> {
    fn of(unit: &ReachAvoid<'a>, point: u32) -> Self {
        Self { task: unit.task, roles: unit.roles, point }
    }
}

/// Adds the states of a tile to its groups.
fn judge<K: Kernel, const N: usize>(
    runner: &TileRunner<'_, K>,
    frame: &mut Frame,
    groups: &mut [Group<N>],
    live: usize,
    Asked { task, roles, point }: Asked<'_>,
) {
    say_when(runner, frame, groups, point);
    let scores = groups.iter_mut().map(|group| {
        let Group { score, step, .. } = group;
        (score, Rule::at_each(task.tightening, roles, step, point))
    });
    runner.judge(frame, live, runner.gamma(task.spec.gamma, point), scores);
    groups.iter_mut().take(live.div_ceil(N)).for_each(|group| group.decide(task.spec.horizon));
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

    /// Notes which signs are known.
    fn decide(&mut self, horizon: u32) {
        let decided = self.score.decided();
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

/// Writes the results of decided trajectories and closes the gaps; returns how many are left.
fn retire<const N: usize>(
    frame: &mut Frame,
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
            let moved = groups[live / N];
            groups[index].copy_lane(lane, &moved, live % N);
            frame.move_lane(index * N + lane, live);
        }
    }
    live
}

/// The next starts, judged at their first state: many are decided before any step.
struct Queue<'a, K, const N: usize> {
    asked: Asked<'a>,
    first: u64,
    count: usize,
    /// Starts loaded so far.
    loaded: usize,
    loader: Loader<K, N>,
    frame: Frame,
    group: Group<N>,
    /// The first so many lanes wait for a place in the tile.
    waiting: usize,
}

impl<'a, K: Kernel, const N: usize> Queue<'a, K, N> {
    fn new(unit: &ReachAvoid<'a>, runner: &TileRunner<'_, K>) -> Self {
        let frame = runner.frame_of(N);
        Self {
            asked: Asked::of(unit, 0),
            first: unit.first,
            count: unit.out.len(),
            loaded: 0,
            loader: Loader::new(runner.kernel(), frame.states().len()),
            frame,
            group: Group::new(),
            waiting: 0,
        }
    }

    /// Loads starts until one waits; false if none is left.
    fn fill(&mut self, runner: &TileRunner<'_, K>, out: &mut [f32]) -> bool {
        while self.waiting == 0 {
            if self.loaded == self.count {
                return false;
            }
            let live = N.min(self.count - self.loaded);
            let first = self.first + self.loaded as u64;
            self.loader.starts(&self.asked.task.starts, first, live, &mut self.frame);
            self.group = Group::new();
            self.group.place = per_lane!(N, i => (self.loaded + i) as u32);
            let group = std::slice::from_mut(&mut self.group);
            judge(runner, &mut self.frame, group, live, self.asked);
            self.loaded += live;
            self.waiting = retire(&mut self.frame, group, live, out);
        }
        true
    }
}
