//! Pairs of rollouts side by side: the farthest pair of each step, and both measures.

use super::dispatch::Unit;
use super::kernel::Kernel;
use super::load::Loader;
use super::rule::{Roles, Rule};
use super::tile::{Score, TilePlant, TileRunner, is_finite, lanes};
use crate::model::Moment;
use crate::real::simd::Body;
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{DeviationTask, Farthest, HUGE, PairControl, PairMeasure};
use crate::tile::Frame;

/// Consecutive pairs for one thread; twin: `shaders/deviation.wgsl`.
pub(super) struct Deviation<'a> {
    /// The plant.
    pub(super) plant: TilePlant<'a>,
    /// The task.
    pub(super) task: &'a DeviationTask<'a>,
    /// What each step is to the plant's task.
    pub(super) roles: &'a Roles,
    /// Most pairs in lockstep.
    pub(super) width: usize,
    /// Index of the first pair.
    pub(super) first: u64,
    /// The measures, one for each pair.
    pub(super) out: &'a mut [PairMeasure],
}

impl Unit for Deviation<'_> {
    /// The farthest pair of each step, `[T + 1]`.
    type Output = Vec<Farthest>;

    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Vec<Farthest> {
        let Self { task, roles, width, .. } = self;
        let mut runner = TileRunner::new(self.plant, kernel, width);
        let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
        let mut pairs = Pairs::<K, N>::new(&runner, width);
        for (tile, out) in self.out.chunks_mut(width).enumerate() {
            let first = self.first + (tile * width) as u64;
            pairs.load(task, first, out.len());
            for (t, farthest) in (0..).zip(&mut farthest) {
                if t > 0 {
                    pairs.decide(&mut runner, task.control);
                }
                for moment in Moment::arriving(t, runner.points()) {
                    if t > 0 {
                        pairs.step(&runner);
                    }
                    let steps = [moment.step; N];
                    let rule = Rule::at(task.tightening, roles, &steps, moment.point);
                    let gamma = runner.gamma(task.spec.gamma, moment.point);
                    pairs.judge(&runner, Look { moment, rule, gamma }, farthest);
                }
            }
            pairs.write(out);
        }
        farthest
    }
}

/// States of the rollouts that are looked at.
struct Look<'a, const N: usize> {
    /// Where on the rollouts they are.
    moment: Moment,
    /// How the margins of the nominal rollouts count.
    rule: Rule<'a, N>,
    /// What their discount is multiplied with behind them.
    gamma: f32,
}

/// A tile of pairs.
struct Pairs<K, const N: usize> {
    loader: Loader<K, N>,
    nominal: Frame,
    perturbed: Frame,
    /// Of the nominal and of the perturbed rollouts, group by group.
    scores: [Vec<Score<N>>; 2],
    first: u64,
    count: usize,
}

impl<K: Kernel, const N: usize> Pairs<K, N> {
    /// Room for `width` pairs.
    fn new(runner: &TileRunner<'_, K>, width: usize) -> Self {
        let nominal = runner.frame();
        Self {
            loader: Loader::new(runner.kernel(), nominal.states().len()),
            nominal,
            perturbed: runner.frame(),
            scores: [(); 2].map(|()| vec![Score::new(); width.div_ceil(N)]),
            first: 0,
            count: 0,
        }
    }

    /// Takes the pairs `first..first + count` in.
    fn load(&mut self, task: &DeviationTask<'_>, first: u64, count: usize) {
        (self.first, self.count) = (first, count);
        let frames = [&mut self.nominal, &mut self.perturbed];
        self.loader.pairs(&task.pairs, first, count, frames);
        self.scores.iter_mut().for_each(|scores| scores.fill(Score::new()));
    }

    /// Decides the controls of both rollouts of each pair.
    fn decide(&mut self, runner: &mut TileRunner<'_, K>, control: PairControl) {
        runner.decide(&mut self.nominal, self.count);
        match control {
            PairControl::Replay => self.perturbed.copy_controls(&self.nominal),
            PairControl::ClosedLoop => runner.decide(&mut self.perturbed, self.count),
        }
    }

    /// Moves both rollouts of each pair one part of a period on.
    fn step(&mut self, runner: &TileRunner<'_, K>) {
        runner.step(&mut self.nominal, self.count);
        runner.step(&mut self.perturbed, self.count);
    }

    /// Adds states to the scores, and their distances to the farthest.
    fn judge(
        &mut self,
        runner: &TileRunner<'_, K>,
        Look { moment, rule, gamma }: Look<'_, N>,
        farthest: &mut Farthest,
    ) {
        let rules = [rule, rule.without_loss()];
        let frames = [&mut self.nominal, &mut self.perturbed];
        for ((frame, scores), rule) in frames.into_iter().zip(&mut self.scores).zip(rules) {
            runner.at(frame, moment);
            let scores = scores.iter_mut().map(|score| (score, rule));
            runner.judge(frame, self.count, gamma, scores);
        }
        for at in (0..self.count).step_by(N) {
            let live = N.min(self.count - at);
            let first = self.first + at as u64;
            let (x, y) = (&self.nominal, &self.perturbed);
            runner.kernel().call(Gap::<N> { x, y, at, live, first, farthest });
        }
    }

    /// Writes the measures of the pairs.
    fn write(&self, out: &mut [PairMeasure]) {
        let [nominal, perturbed] = &self.scores;
        for (out, (nominal, perturbed)) in out.chunks_mut(N).zip(nominal.iter().zip(perturbed)) {
            let (nominal, perturbed) = (nominal.measure().0, perturbed.measure().0);
            for (out, (nominal, perturbed)) in
                out.iter_mut().zip(nominal.into_iter().zip(perturbed))
            {
                *out = PairMeasure { nominal, perturbed };
            }
        }
    }
}

/// Merges the distances of a group of pairs into the farthest.
struct Gap<'a, const N: usize> {
    x: &'a Frame,
    y: &'a Frame,
    /// The first of them in the tile.
    at: usize,
    /// How many of the pairs there are.
    live: usize,
    /// Index of the first of them.
    first: u64,
    farthest: &'a mut Farthest,
}

impl<const N: usize> Body for Gap<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut square = Lanes::<N>::lit(0.0);
        for row in self.x.states() {
            let gap = lanes(self.y, row, self.at) - lanes(self.x, row, self.at);
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
