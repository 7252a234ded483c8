//! A tile of trajectories in groups of lanes: their controls and their scores.

use super::kernel::Kernel;
use super::mlp::{Evaluator, Packed};
use super::rule::Rule;
use crate::model::{Moment, Role, Task};
use crate::real::simd::{Body, Instructions};
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{Fold, HUGE, NON_FINITE};
use crate::tile::{Clock, Frame, Layout, NativeFormula, NativeSystem};

/// Exponent bits of an f32: all set for infinities and NaN.
const EXPONENT: u32 = 0x7f80_0000;

/// Whether `value` is neither infinite nor NaN, by its exponent bits: a compiler may remove
/// `x != x`.
#[inline(always)]
pub(super) fn is_finite(value: f32) -> bool {
    value.to_bits() & EXPONENT != EXPONENT
}

/// A plant and who drives it.
#[derive(Clone, Copy)]
pub(super) struct TilePlant<'a> {
    /// Dynamics and margins.
    pub(super) system: &'a dyn NativeSystem,
    /// What its rollouts have to do.
    pub(super) task: Task,
    /// Parts of a period.
    pub(super) points: u32,
    /// The controls.
    pub(super) law: TileLaw<'a>,
    /// Rows of a frame.
    pub(super) layout: Layout,
    /// Whether formulas read the rows of steps and of periods.
    pub(super) clock: Clock,
    /// The instructions that formulas are evaluated with.
    pub(super) with: Instructions,
}

impl TilePlant<'_> {
    /// Widest layer of all networks that take part; `None` if none does.
    pub(super) fn widest(&self) -> Option<usize> {
        let law = match self.law {
            TileLaw::Formula(formula) => formula.widest(),
            TileLaw::Network { network, observe, act } => {
                let around = [observe, act].into_iter().flatten();
                let around = around.filter_map(|around| around.formula.widest());
                around.chain([network.widest()]).max()
            }
        };
        law.max(self.system.widest())
    }
}

/// Where the controls come from.
#[derive(Clone, Copy)]
pub(super) enum TileLaw<'a> {
    /// A formula of the states.
    Formula(&'a dyn NativeFormula),
    /// A network, packed for the kernel, and what stands around it.
    Network {
        /// The network.
        network: &'a Packed,
        /// What it sees, if not the states.
        observe: Option<Around<'a>>,
        /// The controls from what it says, if not that itself.
        act: Option<Around<'a>>,
    },
}

/// A formula before or behind a network.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    /// The formula.
    pub(super) formula: &'a dyn NativeFormula,
    /// The rows between it and the network.
    pub(super) rows: [usize; 2],
}

impl<'a> TileLaw<'a> {
    /// The network, if there is one.
    pub(super) fn network(self) -> Option<&'a Packed> {
        match self {
            Self::Formula(_) => None,
            Self::Network { network, .. } => Some(network),
        }
    }
}

/// A plant with what it needs to drive tiles.
pub(super) struct TileRunner<'a, K> {
    plant: TilePlant<'a>,
    network: Option<Evaluator<'a, K>>,
    kernel: K,
    lanes: usize,
}

impl<'a, K: Kernel> TileRunner<'a, K> {
    /// For tiles of up to `lanes` trajectories.
    pub(super) fn new(plant: TilePlant<'a>, kernel: K, lanes: usize) -> Self {
        let network = plant.law.network();
        let network = network.map(|network| Evaluator::new(network, kernel, lanes));
        Self { plant, network, kernel, lanes }
    }

    /// Room for a tile.
    pub(super) fn frame(&self) -> Frame {
        self.frame_of(self.lanes)
    }

    /// Room for a tile of up to `lanes` trajectories.
    pub(super) fn frame_of(&self, lanes: usize) -> Frame {
        Frame::new(self.plant.layout, lanes)
    }

    /// Evaluates the policy at the first `lanes` states.
    pub(super) fn decide(&mut self, frame: &mut Frame, lanes: usize) {
        let with = self.plant.with;
        match (self.plant.law, &mut self.network) {
            (TileLaw::Formula(formula), _) => formula.evaluate(with, frame, lanes),
            (TileLaw::Network { observe, act, .. }, Some(network)) => {
                let mut rows = [frame.states(), frame.controls()];
                if let Some(Around { formula, rows: [first, end] }) = observe {
                    formula.evaluate(with, frame, lanes);
                    rows[0] = first..end;
                }
                if let Some(Around { rows: [first, end], .. }) = act {
                    rows[1] = first..end;
                }
                network.forward(frame, rows, lanes);
                if let Some(Around { formula, .. }) = act {
                    formula.evaluate(with, frame, lanes);
                }
            }
            (TileLaw::Network { .. }, None) => unreachable!("a network has its evaluator"),
        }
    }

    /// Moves the first `lanes` states one part of a period on, by the controls decided last.
    pub(super) fn step(&self, frame: &mut Frame, lanes: usize) {
        self.plant.system.step(self.plant.with, frame, lanes);
    }

    /// Says that the states are those of `moment`.
    pub(super) fn at(&self, frame: &mut Frame, moment: Moment) {
        if self.plant.clock == Clock::Read {
            let [step, elapsed] = [frame.step(), frame.elapsed()];
            frame.row_mut(step).fill(moment.step as f32);
            frame.row_mut(elapsed).fill(moment.elapsed(self.plant.points));
        }
    }

    /// Says of which moment each state is.
    pub(super) fn at_each(&self, frame: &mut Frame, moments: impl Iterator<Item = Moment>) {
        if self.plant.clock == Clock::Read {
            let [step, elapsed] = [frame.step(), frame.elapsed()];
            for (lane, moment) in (0..frame.width()).zip(moments) {
                frame.row_mut(step)[lane] = moment.step as f32;
                frame.row_mut(elapsed)[lane] = moment.elapsed(self.plant.points);
            }
        }
    }

    /// Parts of a period.
    pub(super) fn points(&self) -> u32 {
        self.plant.points
    }

    /// What the discount of states is multiplied with behind those that are number `point` of their period:
    /// all of a period have that of its sample.
    pub(super) fn gamma(&self, gamma: f32, point: u32) -> f32 {
        if point + 1 == self.plant.points { gamma } else { 1.0 }
    }

    /// Adds the first `lanes` states to the scores of their groups, each by its rule.
    pub(super) fn judge<'s, const N: usize>(
        &self,
        frame: &mut Frame,
        lanes: usize,
        gamma: f32,
        scores: impl Iterator<Item = (&'s mut Score<N>, Rule<'s, N>)>,
    ) {
        self.plant.system.margins(self.plant.with, frame, lanes);
        let scores = scores.take(lanes.div_ceil(N));
        let steps = if self.plant.task.is_plain() { Steps::Alike } else { Steps::Differ };
        self.kernel.call(Judge { frame, scores, gamma, steps });
    }

    /// The kernel, for other bodies.
    pub(super) fn kernel(&self) -> K {
        self.kernel
    }
}

/// The numbers of a row from trajectory `at` on.
#[inline(always)]
pub(super) fn lanes<const N: usize>(frame: &Frame, row: usize, at: usize) -> Lanes<N> {
    let mut lanes = [0.0; N];
    lanes.copy_from_slice(&frame.rows()[row * frame.width() + at..][..N]);
    Lanes(lanes)
}

/// Whether what a step is to the task differs from step to step.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Steps {
    /// All are those of a reach-avoid task without a window, which needs no masks.
    Alike,
    /// Each has a role of its own.
    Differ,
}

/// The margins of the groups of a tile, folded: one body for all of them.
struct Judge<'a, I> {
    frame: &'a Frame,
    /// The score of each group, and how its margins count.
    scores: I,
    gamma: f32,
    steps: Steps,
}

impl<'s, I, const N: usize> Body for Judge<'_, I>
where
    I: Iterator<Item = (&'s mut Score<N>, Rule<'s, N>)>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { frame, scores, gamma, steps } = self;
        let (states, [target_row, constraint_row]) = (frame.states().len(), frame.margins());
        for (group, (score, rule)) in scores.enumerate() {
            let at = group * N;
            // Infinite margins are satisfied or violated, only a NaN fails the rollout. Nothing is mapped here:
            // what a closure returns goes through memory.
            let rows = [lanes(frame, target_row, at), lanes(frame, constraint_row, at)];
            let [target, constraint] = rule.act(rows);
            let [mut target, mut constraint] = [bounded(target), bounded(constraint)];
            if steps == Steps::Differ {
                [target, constraint] = rule.seen(target, constraint);
            }
            let mut largest = with_largest(with_largest([0; N], target), constraint);
            for row in 0..states {
                largest = with_largest(largest, lanes(frame, row, at));
            }
            match steps {
                Steps::Alike => score.add(target, constraint, largest, gamma),
                Steps::Differ => score.add_as(&rule.roles(), [target, constraint], largest, gamma),
            }
        }
    }
}

/// Infinite margins as the largest number; NaN stays.
#[inline(always)]
fn bounded<const N: usize>(margin: Lanes<N>) -> Lanes<N> {
    Lanes(per_lane!(N, i => {
        let infinite = margin.0[i].abs().to_bits() == EXPONENT;
        if infinite { f32::MAX.copysign(margin.0[i]) } else { margin.0[i] }
    }))
}

/// The larger of `largest` and the bits of `values` without their sign.
#[inline(always)]
fn with_largest<const N: usize>(largest: [u32; N], values: Lanes<N>) -> [u32; N] {
    per_lane!(N, i => values.0[i].abs().to_bits().max(largest[i]))
}

/// The measures of a group so far.
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

    /// The same where steps differ in what they are to the task; once it is over, nothing fails.
    #[inline(always)]
    fn add_as(&mut self, roles: &[u32; N], margins: [Lanes<N>; 2], largest: [u32; N], gamma: f32) {
        self.failed = per_lane!(N, i => {
            self.failed[i] | (u32::from(largest[i] >= EXPONENT) & roles[i] & Role::LIVE.bits())
        });
        // Nothing holds any more where the rollout failed: no chance is left, and nothing concludes.
        let roles = per_lane!(N, i => {
            if self.failed[i] != 0 { Role::CONSTRAINT.bits() } else { roles[i] }
        });
        let [target, constraint] = margins;
        let constraint = lost(&self.failed, constraint);
        self.fold.add_each(&roles, target, constraint, gamma);
    }

    /// The measures; [`NON_FINITE`] where the rollout failed before it succeeded.
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

    /// Not 0 where no later state can change the sign of the measure: success, or what had to hold does not.
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
