//! The softmin of a unit of samples, lane by lane, so that a group costs a few operations.

use std::marker::PhantomData;

use super::kernel::Kernel;
use super::tile::is_finite;
use crate::real::simd::Body;
use crate::real::{Lanes, Real, Vector, per_lane};
use crate::rollout::{HUGE, Partial};

/// Lanes that are summed on their own, whatever the instructions: samples that lie this far apart
/// share one, so that the bits do not depend on the lanes per group.
const SHARES: usize = 32;

/// Weighted sums of the samples seen so far; twin: `shaders/mppi_update.wgsl`.
pub(super) struct Softmin<const N: usize> {
    temperature: f32,
    /// Groups take turns.
    sets: Vec<Sums<N>>,
    /// Samples so far.
    count: u32,
    turn: usize,
}

/// The samples of each lane, weighted against the smallest cost among them.
struct Sums<const N: usize> {
    least: Lanes<N>,
    best: [u32; N],
    weight: Lanes<N>,
    squares: Lanes<N>,
    cost: Lanes<N>,
    non_finite: [u32; N],
    /// `[H, controls]`.
    controls: Vec<Lanes<N>>,
}

impl<const N: usize> Softmin<N> {
    /// No sample yet, for plans of `length` controls in all.
    pub(super) fn new(length: usize, temperature: f32) -> Self {
        let zero = Lanes([0.0; N]);
        let sums = || Sums {
            least: Lanes([HUGE; N]),
            best: [u32::MAX; N],
            weight: zero,
            squares: zero,
            cost: zero,
            non_finite: [0; N],
            controls: vec![zero; length],
        };
        Self { temperature, sets: (0..SHARES / N).map(|_| sums()).collect(), count: 0, turn: 0 }
    }

    /// Adds the first `live` samples of a group; the first of them has the number `first`.
    pub(super) fn add<K: Kernel>(
        &mut self,
        kernel: K,
        cost: &Lanes<N>,
        controls: &[[f32; N]],
        first: u32,
        live: usize,
    ) {
        self.count += live as u32;
        let sums = &mut self.sets[self.turn];
        let temperature = self.temperature;
        let kind = PhantomData::<K>;
        kernel.call(Add { kind, sums, temperature, cost, controls, first, live });
        self.turn = (self.turn + 1) % self.sets.len();
    }

    /// All lanes together.
    pub(super) fn finish(self) -> Partial {
        let all = |part: fn(&Sums<N>) -> [f32; N]| gather(&self.sets, part);
        let least = all(|sums| sums.least.0);
        let smallest = least.into_iter().fold(HUGE, f32::min);
        let mut scale = [0.0_f32; SHARES];
        for (scale, least) in scale.iter_mut().zip(least) {
            let excess = f64::from(smallest) - f64::from(least);
            *scale = (excess / f64::from(self.temperature)).exp() as f32;
        }
        let weighed =
            |values: [f32; SHARES]| f64::from(tree(per_lane!(SHARES, i => values[i] * scale[i])));
        let length = self.sets[0].controls.len();
        let controls = (0..length).map(|i| weighed(gather(&self.sets, |sums| sums.controls[i].0)));
        let best = self.sets.iter().flat_map(|sums| sums.least.0.into_iter().zip(sums.best));
        let best = best.filter(|(cost, _)| *cost == smallest).map(|(_, best)| best).min();
        let non_finite = self.sets.iter().flat_map(|sums| sums.non_finite).sum();
        let squares = all(|sums| sums.squares.0);
        let weight = weighed(all(|sums| sums.weight.0));
        Partial {
            count: self.count,
            least: if weight > 0.0 { smallest } else { f32::INFINITY },
            best: best.filter(|best| *best != u32::MAX).unwrap_or(0),
            weight,
            squares: weighed(per_lane!(SHARES, i => squares[i] * scale[i])),
            cost: all(|sums| sums.cost.0).into_iter().map(f64::from).sum(),
            non_finite,
            controls: controls.collect(),
        }
    }
}

/// The lanes of all sets, one after the other.
fn gather<const N: usize>(sets: &[Sums<N>], part: impl Fn(&Sums<N>) -> [f32; N]) -> [f32; SHARES] {
    let mut all = [0.0; SHARES];
    for (out, sums) in all.chunks_mut(N).zip(sets) {
        out.copy_from_slice(&part(sums));
    }
    all
}

/// The sum by halves: the same order on every machine.
fn tree(mut terms: [f32; SHARES]) -> f32 {
    let mut half = SHARES / 2;
    while half > 0 {
        for i in 0..half {
            terms[i] += terms[i + half];
        }
        half /= 2;
    }
    terms[0]
}

/// Adds a group to the sums of its lanes.
struct Add<'a, K, const N: usize> {
    kind: PhantomData<K>,
    sums: &'a mut Sums<N>,
    temperature: f32,
    cost: &'a Lanes<N>,
    controls: &'a [[f32; N]],
    first: u32,
    live: usize,
}

impl<K: Kernel, const N: usize> Body for Add<'_, K, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { sums, cost, first, live, .. } = self;
        let counts = per_lane!(N, i => i < live && is_finite(cost.0[i]) && cost.0[i] < HUGE);
        let cost = Lanes(per_lane!(N, i => if counts[i] { cost.0[i] } else { HUGE }));
        let temperature = Lanes::lit(self.temperature);
        let least = sums.least.min(cost);
        let keep = ((least - sums.least) / temperature).exp_negative();
        let raw = ((least - cost) / temperature).exp_negative();
        let weight = Lanes(per_lane!(N, i => if counts[i] { raw.0[i] } else { 0.0 }));
        let better = per_lane!(N, i => counts[i] && cost.0[i] < sums.least.0[i]);
        sums.best = per_lane!(N, i => if better[i] { first + i as u32 } else { sums.best[i] });
        sums.least = least;
        sums.weight = sums.weight * keep + weight;
        sums.squares = sums.squares * (keep * keep) + weight * weight;
        let finite = Lanes(per_lane!(N, i => if counts[i] { cost.0[i] } else { 0.0 }));
        sums.cost = sums.cost + finite;
        sums.non_finite = per_lane!(N, i => sums.non_finite[i] + u32::from(i < live && !counts[i]));
        for at in (0..N).step_by(K::Vector::WIDTH) {
            let load = |numbers: &[f32; N]| K::Vector::load(&numbers[at..]);
            let (keep, weight) = (load(&keep.0), load(&weight.0));
            for (sum, u) in sums.controls.iter_mut().zip(self.controls) {
                (load(&sum.0) * keep + weight * load(u)).store(&mut sum.0[at..]);
            }
        }
    }
}
