//! Control noise of MPPI: a function of seed, stream, sample and step, on every backend.

use super::mppi_settings::{MppiSettings, NoiseKind};
use super::philox::philox;
use super::sample::{Stream, normal_pair, unit};
use crate::error::{Error, Result};
use crate::real::{Lanes, Real, Vector, load_rows, per_lane, store_rows};

/// Knots that a step of a spline depends on.
pub const SPLINE_SUPPORT: usize = 4;

/// The noise of all samples: standard normal numbers, shaped over time, then scaled.
///
/// Normal number `n` of a sample is entry `n % 4` of the block `n / 4`, and belongs to control
/// `n % NU` of the draw `n / NU`, a step or a knot, of NU controls.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    factor: Factor,
    controls: usize,
    horizon: usize,
    antithetic: bool,
    shape: NoiseShape,
}

/// The lower triangular factor of the covariance.
#[derive(Clone, Debug, PartialEq)]
enum Factor {
    /// Its diagonal, where there is nothing else.
    Diagonal(Vec<f32>),
    /// All of it, row by row.
    Lower(Vec<f32>),
}

/// How draws become steps.
#[derive(Clone, Debug, PartialEq)]
pub enum NoiseShape {
    /// A draw for each step.
    Independent,
    /// `z_t = keep z_{t-1} + fresh xi_t`, `z_0 = xi_0`, unit variance.
    Colored {
        /// Correlation of neighbours.
        keep: f32,
        /// `sqrt(1 - keep^2)`.
        fresh: f32,
    },
    /// A weighted sum of the knots for each step.
    Spline {
        /// Number of knots.
        knots: usize,
        /// Which knots each step takes.
        rows: Vec<SplineRow>,
    },
}

/// The knots `first..first + 4` of a step and their weights, whose squares sum to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineRow {
    /// First knot; those past the last have weight 0.
    pub first: u32,
    /// Weights.
    pub weights: [f32; SPLINE_SUPPORT],
}

impl Noise {
    /// The noise that `settings` ask for, scaled by the lower triangular `factor`.
    /// `factor` is given row by row.
    pub(super) fn new(settings: &MppiSettings, factor: Vec<f32>) -> Result<Self> {
        let controls = settings.bounds.len();
        if factor.len() != controls * controls {
            let problem =
                format!("is of {} controls; there are bounds for {controls}", factor.len().isqrt());
            return Err(Error::invalid("sigma", problem));
        }
        let independent = settings.noise == NoiseKind::Independent;
        if settings.noise_cost && !independent {
            let problem = "the noise cost is that of independent noise; take one or the other";
            return Err(Error::invalid("noise_cost", problem));
        }
        let shape = match settings.noise {
            NoiseKind::Independent => NoiseShape::Independent,
            NoiseKind::Colored { time } => colored(time)?,
            NoiseKind::Spline { knots } => spline(knots, settings.horizon)?,
        };
        let horizon = settings.horizon as usize;
        let factor = Factor::new(factor, controls);
        Ok(Self { factor, controls, horizon, antithetic: settings.antithetic, shape })
    }

    /// Entry `j` of row `i` of the lower triangular factor of the covariance.
    pub fn factor(&self, i: usize, j: usize) -> f32 {
        match &self.factor {
            Factor::Diagonal(own) if i == j => own[i],
            Factor::Diagonal(_) => 0.0,
            Factor::Lower(all) => all[i * self.controls + j],
        }
    }

    /// Number of controls.
    pub fn controls(&self) -> usize {
        self.controls
    }

    /// Whether neighbouring samples have opposite noise.
    pub fn antithetic(&self) -> bool {
        self.antithetic
    }

    /// How draws become steps.
    pub fn shape(&self) -> &NoiseShape {
        &self.shape
    }

    /// Vectors of NU normal numbers that a sample draws.
    pub fn draws(&self) -> usize {
        match &self.shape {
            NoiseShape::Spline { knots, .. } => *knots,
            _ => self.horizon,
        }
    }

    /// Room for the normal numbers of a group: whole blocks.
    pub(crate) fn room(&self) -> usize {
        (self.draws() * self.controls).next_multiple_of(4)
    }

    /// The noise of the samples `first..first + N`, `[H, controls]`, computed in vectors `V` that N is a
    /// multiple of; `normals` is scratch of [`Self::room`].
    ///
    /// # Panics
    /// If a slice is too short.
    #[inline(always)]
    pub(crate) fn fill<V: Vector, const N: usize>(
        &self,
        stream: Stream,
        iteration: u32,
        first: u32,
        normals: &mut [Lanes<N>],
        noise: &mut [[f32; N]],
    ) {
        self.draw::<V, N>(stream, iteration, first, normals);
        let (steps, count) = (noise.chunks_exact_mut(self.controls).enumerate(), self.controls);
        match &self.shape {
            NoiseShape::Independent => {
                for (t, e) in steps {
                    self.scale::<V, N>(&normals[t * count..][..count], e);
                }
            }
            NoiseShape::Colored { keep, fresh } => {
                for (t, e) in steps {
                    // The correlated numbers take the place of the fresh ones.
                    let (before, now) = normals.split_at_mut(t * count);
                    if t > 0 {
                        let before = &before[(t - 1) * count..];
                        correlate::<V, N>([*keep, *fresh], before, &mut now[..count]);
                    }
                    self.scale::<V, N>(&now[..count], e);
                }
            }
            NoiseShape::Spline { knots, rows } => {
                for ((_, e), row) in steps.zip(rows) {
                    between::<V, N>(normals, *knots, row, e);
                    self.scale_in_place::<V, N>(e);
                }
            }
        }
    }

    /// The standard normal numbers of the samples `first..first + N`.
    #[inline(always)]
    fn draw<V: Vector, const N: usize>(
        &self,
        stream: Stream,
        iteration: u32,
        first: u32,
        normals: &mut [Lanes<N>],
    ) {
        let one = Lanes::<N>::lit(1.0);
        let (index, sign) = self.index(first);
        for (block, four) in normals[..self.room()].as_chunks_mut::<4>().0.iter_mut().enumerate() {
            let counter = [index, [iteration; N], [block as u32; N], [stream.id(); N]];
            let [a, b, c, d] = philox(counter, stream.key());
            *four = [one - unit(a), unit(b), one - unit(c), unit(d)];
            for at in (0..N).step_by(V::WIDTH) {
                let [a, b, c, d] = load_rows::<V, N, 4>(four, at);
                let (even, odd) = (normal_pair(a, b), normal_pair(c, d));
                store_rows([even[0], even[1], odd[0], odd[1]], four, at);
            }
            if self.antithetic {
                for z in four {
                    *z = *z * sign;
                }
            }
        }
    }

    /// Index and sign of the noise of the samples `first..first + N`.
    #[inline(always)]
    fn index<const N: usize>(&self, first: u32) -> ([u32; N], Lanes<N>) {
        let sample = per_lane!(N, i => first + i as u32);
        if !self.antithetic {
            return (sample, Lanes([1.0; N]));
        }
        let sign = per_lane!(N, i => if sample[i] % 2 == 0 { 1.0 } else { -1.0 });
        (per_lane!(N, i => sample[i] / 2), Lanes(sign))
    }

    /// `L z`.
    #[inline(always)]
    fn scale<V: Vector, const N: usize>(&self, z: &[Lanes<N>], e: &mut [[f32; N]]) {
        match &self.factor {
            Factor::Diagonal(own) => {
                for ((e, z), own) in e.iter_mut().zip(z).zip(own) {
                    for at in (0..N).step_by(V::WIDTH) {
                        (V::lit(*own) * V::load(&z.0[at..])).store(&mut e[at..]);
                    }
                }
            }
            Factor::Lower(all) => {
                for (i, e) in e.iter_mut().enumerate() {
                    let row = &all[i * self.controls..][..=i];
                    for at in (0..N).step_by(V::WIDTH) {
                        scaled(row, |j| V::load(&z[j].0[at..])).store(&mut e[at..]);
                    }
                }
            }
        }
    }

    /// `L e` in the place of `e`: the last control first, which none before it needs.
    #[inline(always)]
    fn scale_in_place<V: Vector, const N: usize>(&self, e: &mut [[f32; N]]) {
        for i in (0..e.len()).rev() {
            for at in (0..N).step_by(V::WIDTH) {
                let z = |j: usize| V::load(&e[j][at..]);
                let scaled = match &self.factor {
                    Factor::Diagonal(own) => V::lit(own[i]) * z(i),
                    Factor::Lower(all) => scaled(&all[i * self.controls..][..=i], z),
                };
                scaled.store(&mut e[i][at..]);
            }
        }
    }

    /// The noise of one sample, `[H, controls]`.
    pub fn sample(&self, stream: Stream, iteration: u32, sample: u32) -> Vec<f32> {
        let mut normals = vec![Lanes([0.0; 1]); self.room()];
        let mut noise = vec![[0.0; 1]; self.horizon * self.controls];
        self.fill::<Lanes<1>, 1>(stream, iteration, sample, &mut normals, &mut noise);
        noise.into_flattened()
    }
}

impl Factor {
    /// The matrix whose rows `all` has one after the other.
    fn new(all: Vec<f32>, controls: usize) -> Self {
        let beside = |(place, entry): (usize, &f32)| place % (controls + 1) != 0 && *entry != 0.0;
        match all.iter().enumerate().any(beside) {
            true => Self::Lower(all),
            false => Self::Diagonal(all.into_iter().step_by(controls + 1).collect()),
        }
    }
}

/// The last entry of `L z`, where `row` is the last row of L.
#[inline(always)]
fn scaled<V: Vector>(row: &[f32], z: impl Fn(usize) -> V) -> V {
    let last = row.len() - 1;
    let mut sum = V::lit(row[last]) * z(last);
    for (j, factor) in row[..last].iter().enumerate() {
        if *factor != 0.0 {
            sum = sum + V::lit(*factor) * z(j);
        }
    }
    sum
}

/// The next of correlated numbers, in the place of fresh ones.
#[inline(always)]
fn correlate<V: Vector, const N: usize>(
    [keep, fresh]: [f32; 2],
    before: &[Lanes<N>],
    now: &mut [Lanes<N>],
) {
    for (z, before) in now.iter_mut().zip(before) {
        for at in (0..N).step_by(V::WIDTH) {
            let kept = V::lit(keep) * V::load(&before.0[at..]);
            (kept + V::lit(fresh) * V::load(&z.0[at..])).store(&mut z.0[at..]);
        }
    }
}

/// The weighted sum of the knots of a step.
#[inline(always)]
fn between<V: Vector, const N: usize>(
    normals: &[Lanes<N>],
    knots: usize,
    row: &SplineRow,
    z: &mut [[f32; N]],
) {
    let (count, weights) =
        (z.len(), &row.weights[..SPLINE_SUPPORT.min(knots - row.first as usize)]);
    for (i, z) in z.iter_mut().enumerate() {
        for at in (0..N).step_by(V::WIDTH) {
            let mut sum = V::lit(0.0);
            for (k, weight) in weights.iter().enumerate() {
                let knot = &normals[(row.first as usize + k) * count + i];
                sum = sum + V::lit(*weight) * V::load(&knot.0[at..]);
            }
            sum.store(&mut z[at..]);
        }
    }
}

/// Autoregression with correlation time `time`.
fn colored(time: f32) -> Result<NoiseShape> {
    if !(time > 0.0 && time.is_finite()) {
        let problem = format!("{time} is not a positive number of steps");
        return Err(Error::invalid("noise.time", problem));
    }
    let keep = (-1.0 / f64::from(time)).exp();
    Ok(NoiseShape::Colored { keep: keep as f32, fresh: (1.0 - keep * keep).sqrt() as f32 })
}

/// A Catmull-Rom spline through `knots` knots over `horizon` steps, its end knots doubled.
fn spline(knots: u32, horizon: u32) -> Result<NoiseShape> {
    if !(1..=horizon).contains(&knots) {
        let problem = format!("{knots} is not within 1..={horizon}, the steps of the plan");
        return Err(Error::invalid("noise.knots", problem));
    }
    let last = knots - 1;
    let rows = (0..horizon).map(|t| {
        let place = f64::from(t) * f64::from(last) / f64::from((horizon - 1).max(1));
        let before = (place.floor() as u32).min(last.saturating_sub(1));
        spline_row(before, place - f64::from(before), last)
    });
    Ok(NoiseShape::Spline { knots: knots as usize, rows: rows.collect() })
}

/// The knots around `before + s` and their weights.
fn spline_row(before: u32, s: f64, last: u32) -> SplineRow {
    let (s2, s3) = (s * s, s * s * s);
    let basis = [
        0.5 * (-s + 2.0 * s2 - s3),
        0.5 * (2.0 - 5.0 * s2 + 3.0 * s3),
        0.5 * (s + 4.0 * s2 - 3.0 * s3),
        0.5 * (s3 - s2),
    ];
    let first = before.saturating_sub(1).min((last + 1).saturating_sub(SPLINE_SUPPORT as u32));
    let mut weights = [0.0; SPLINE_SUPPORT];
    for (offset, weight) in basis.into_iter().enumerate() {
        let knot = (before + offset as u32).saturating_sub(1).min(last);
        weights[(knot - first) as usize] += weight;
    }
    let length = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    SplineRow { first, weights: weights.map(|weight| (weight / length) as f32) }
}
