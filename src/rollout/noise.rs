//! Control noise of MPPI: a function of seed, stream, sample and step, on every backend.

use super::mppi::{MppiSettings, NoiseKind};
use super::philox::philox;
use super::sample::{Stream, normal_pair, unit};
use crate::error::{Error, Result};
use crate::real::{Lanes, Real, Vector, load_rows, per_lane, store_rows};

/// Knots that a step of a spline depends on.
pub const SPLINE_SUPPORT: usize = 4;

/// The noise of all samples: standard normal numbers, shaped over time, then scaled.
///
/// Normal number `n` of a sample is entry `n % 4` of the block `n / 4`, and belongs to control
/// `n % NU` of the draw `n / NU`: a step, or a knot.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise<const NU: usize> {
    factor: [[f32; NU]; NU],
    horizon: usize,
    antithetic: bool,
    shape: NoiseShape,
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

impl<const NU: usize> Noise<NU> {
    /// The noise that `settings` ask for, scaled by the lower triangular `factor`.
    pub(super) fn new(settings: &MppiSettings<NU>, factor: [[f32; NU]; NU]) -> Result<Self> {
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
        Ok(Self { factor, horizon, antithetic: settings.antithetic, shape })
    }

    /// The lower triangular factor of the covariance.
    pub fn factor(&self) -> &[[f32; NU]; NU] {
        &self.factor
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
        (self.draws() * NU).next_multiple_of(4)
    }

    /// The noise of the samples `first..first + N`, `[H]`, computed in vectors `V` that N is a
    /// multiple of; `normals` is scratch of [`Self::room`].
    ///
    /// # Panics
    /// If a slice is too short.
    #[inline(always)]
    pub(crate) fn fill<V: Vector, const N: usize>(
        &self,
        (stream, iteration): (Stream, u32),
        first: u32,
        normals: &mut [Lanes<N>],
        noise: &mut [[Lanes<N>; NU]],
    ) {
        self.draw::<V, N>((stream, iteration), first, normals);
        match &self.shape {
            NoiseShape::Independent => {
                for (t, e) in noise[..self.horizon].iter_mut().enumerate() {
                    *e = self.scaled(&vector(normals, t));
                }
            }
            NoiseShape::Colored { keep, fresh } => {
                let (keep, fresh) = (Lanes::lit(*keep), Lanes::lit(*fresh));
                let mut z: [Lanes<N>; NU] = vector(normals, 0);
                for (t, e) in noise[..self.horizon].iter_mut().enumerate() {
                    if t > 0 {
                        let xi = vector::<N, NU>(normals, t);
                        for (z, xi) in z.iter_mut().zip(xi) {
                            *z = keep * *z + fresh * xi;
                        }
                    }
                    *e = self.scaled(&z);
                }
            }
            NoiseShape::Spline { knots, rows } => {
                for (e, row) in noise.iter_mut().zip(rows) {
                    *e = self.scaled(&between(normals, *knots, row));
                }
            }
        }
    }

    /// The standard normal numbers of the samples `first..first + N`.
    #[inline(always)]
    fn draw<V: Vector, const N: usize>(
        &self,
        (stream, iteration): (Stream, u32),
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
    fn scaled<const N: usize>(&self, z: &[Lanes<N>; NU]) -> [Lanes<N>; NU] {
        let mut e = [Lanes([0.0; N]); NU];
        for i in 0..NU {
            e[i] = Lanes::lit(self.factor[i][i]) * z[i];
            for (factor, z) in self.factor[i][..i].iter().zip(z) {
                if *factor != 0.0 {
                    e[i] = e[i] + Lanes::lit(*factor) * *z;
                }
            }
        }
        e
    }

    /// The noise of one sample, `[H]`.
    pub fn sample(&self, stream: Stream, iteration: u32, sample: u32) -> Vec<[f32; NU]> {
        let mut normals = vec![Lanes([0.0; 1]); self.room()];
        let mut noise = vec![[Lanes([0.0; 1]); NU]; self.horizon];
        self.fill::<Lanes<1>, 1>((stream, iteration), sample, &mut normals, &mut noise);
        noise.into_iter().map(|e| e.map(|lane| lane.0[0])).collect()
    }
}

/// The draw number `draw`.
#[inline(always)]
fn vector<const N: usize, const NU: usize>(normals: &[Lanes<N>], draw: usize) -> [Lanes<N>; NU] {
    let mut z = [Lanes([0.0; N]); NU];
    z.copy_from_slice(&normals[draw * NU..][..NU]);
    z
}

/// The weighted sum of the knots of a step.
#[inline(always)]
fn between<const N: usize, const NU: usize>(
    normals: &[Lanes<N>],
    knots: usize,
    row: &SplineRow,
) -> [Lanes<N>; NU] {
    let mut z = [Lanes([0.0; N]); NU];
    for (k, weight) in row.weights.iter().enumerate().take(knots - row.first as usize) {
        let knot = vector::<N, NU>(normals, row.first as usize + k);
        for (z, knot) in z.iter_mut().zip(knot) {
            *z = *z + Lanes::lit(*weight) * knot;
        }
    }
    z
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
