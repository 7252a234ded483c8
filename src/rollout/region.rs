//! Sets of states with the uniform distribution on them: boxes, balls and ellipsoids.

use super::ellipsoid::Ellipsoid;
use super::sample::{Stream, normal_pair, unit};
use crate::error::{Error, Result};
use crate::real::{Lanes, Real};

/// A set of states with the uniform distribution on it.
#[derive(Clone, Debug, PartialEq)]
pub enum Region {
    /// An axis-parallel box.
    Box {
        /// Lower corner.
        low: Vec<f32>,
        /// Upper corner; a coordinate with `low == high` is frozen.
        high: Vec<f32>,
    },
    /// A Euclidean ball in some coordinates, the others frozen.
    Ball(Ball),
    /// An axis-parallel ellipsoid in some coordinates, the others frozen.
    Ellipsoid(Ellipsoid),
}

/// A Euclidean ball in the coordinates that are not frozen.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball {
    /// Centre; also the value of the frozen coordinates.
    pub center: Vec<f32>,
    /// Radius.
    pub radius: f32,
    /// Whether each coordinate varies.
    pub varies: Vec<bool>,
}

impl Ball {
    /// Number of coordinates that vary.
    pub fn dimension(&self) -> usize {
        self.varies.iter().filter(|varies| **varies).count()
    }

    /// Distance of `x` from the centre in the coordinates that vary.
    pub fn distance(&self, x: &[f32]) -> f64 {
        let square = |i: usize| (f64::from(x[i]) - f64::from(self.center[i])).powi(2);
        (0..x.len()).filter(|&i| self.varies[i]).map(square).sum::<f64>().sqrt()
    }

    /// Whether `x` lies in the ball, its frozen coordinates equal to the centre's.
    pub fn contains(&self, x: &[f32]) -> bool {
        let frozen = (0..x.len()).all(|i| self.varies[i] || x[i] == self.center[i]);
        frozen && self.distance(x) <= f64::from(self.radius)
    }
}

impl Region {
    /// A box, checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the corners have not the same number of coordinates, a bound is not
    /// finite, `low > high`, or no coordinate varies.
    pub fn new_box(low: impl Into<Vec<f32>>, high: impl Into<Vec<f32>>) -> Result<Self> {
        let place = "box";
        let (low, high) = (low.into(), high.into());
        if low.len() != high.len() {
            let problem = format!("corners of {} and {} coordinates", low.len(), high.len());
            return Err(Error::invalid(place, problem));
        }
        for (i, (low, high)) in low.iter().zip(&high).enumerate() {
            if !(low.is_finite() && high.is_finite() && low <= high) {
                let problem = format!("coordinate {i} has the empty interval [{low}, {high}]");
                return Err(Error::invalid(place, problem));
            }
        }
        if low == high {
            return Err(Error::invalid(place, "empty: low equals high in every coordinate"));
        }
        Ok(Self::Box { low, high })
    }

    /// Number of coordinates.
    pub fn size(&self) -> usize {
        match self {
            Self::Box { low, .. } => low.len(),
            Self::Ball(ball) => ball.center.len(),
            Self::Ellipsoid(set) => set.center.len(),
        }
    }

    /// Whether each coordinate varies.
    pub fn varies(&self) -> Vec<bool> {
        match self {
            Self::Box { low, high } => low.iter().zip(high).map(|(low, high)| low < high).collect(),
            Self::Ball(ball) => ball.varies.clone(),
            Self::Ellipsoid(set) => set.varies(),
        }
    }

    /// What it is, in a sentence.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Box { .. } => "box",
            Self::Ball(_) => "ball",
            Self::Ellipsoid(_) => "ellipsoid",
        }
    }

    /// Volume in the coordinates that vary.
    pub fn volume(&self) -> f64 {
        match self {
            Self::Box { low, high } => {
                let sides = low.iter().zip(high);
                let widths = sides.map(|(low, high)| f64::from(*high) - f64::from(*low));
                widths.filter(|width| *width > 0.0).product()
            }
            Self::Ball(ball) => {
                let dimension = ball.dimension();
                unit_volume(dimension) * f64::from(ball.radius).powi(dimension as i32)
            }
            Self::Ellipsoid(set) => {
                let halves = || set.half_axes.iter().filter(|half| **half > 0.0);
                let product = halves().map(|half| f64::from(*half)).product::<f64>();
                unit_volume(halves().count()) * product
            }
        }
    }

    /// Whether `x` lies in the region, its frozen coordinates as the region has them.
    pub fn contains(&self, x: &[f32]) -> bool {
        match self {
            Self::Box { low, high } => (0..x.len()).all(|i| low[i] <= x[i] && x[i] <= high[i]),
            Self::Ball(ball) => ball.contains(x),
            Self::Ellipsoid(set) => set.contains(x),
        }
    }

    /// The samples `first..first + N` of the uniform distribution, one per lane; `x` has a row for
    /// each coordinate.
    #[inline(always)]
    pub fn sample<const N: usize>(&self, stream: Stream, first: u64, x: &mut [Lanes<N>]) {
        match self {
            Self::Box { low, high } => stream.uniform_in(low, high, first, x),
            Self::Ball(ball) => {
                sample_ball(stream, first, |i| ball.varies[i], x);
                for (x, center) in x.iter_mut().zip(&ball.center) {
                    *x = Lanes::lit(*center) + Lanes::lit(ball.radius) * *x;
                }
            }
            Self::Ellipsoid(set) => {
                sample_ball(stream, first, |i| set.half_axes[i] > 0.0, x);
                for (x, (center, half)) in x.iter_mut().zip(set.center.iter().zip(&set.half_axes)) {
                    *x = Lanes::lit(*center) + Lanes::lit(*half) * *x;
                }
            }
        }
    }

    /// The sample number `index`.
    pub fn point(&self, stream: Stream, index: u64) -> Vec<f32> {
        let mut x = vec![Lanes([0.0]); self.size()];
        self.sample::<1>(stream, index, &mut x);
        x.into_iter().map(|lane| lane.0[0]).collect()
    }
}

/// Volume of the unit ball in `n` dimensions: `V_n = V_{n-2} 2 pi / n`, from V_0 = 1 and V_1 = 2.
fn unit_volume(n: usize) -> f64 {
    let first = if n.is_multiple_of(2) { 1.0 } else { 2.0 };
    let factors = (2..=n).filter(|k| k % 2 == n % 2);
    factors.fold(first, |v, k| v * std::f64::consts::TAU / k as f64)
}

/// Uniform offsets in the unit ball of the coordinates that vary, 0 in the others; `x` has a row
/// for each coordinate.
///
/// With `z` standard normal and `E` exponential, `z / sqrt(|z|^2 + 2 E)` is uniform in the ball
/// (Barthe, Guedon, Mendelson and Naor 2005): the distribution of a random direction times
/// `u^(1/n)`, without the root. Coordinates `2k` and `2k + 1` take the words `2k` and `2k + 1`
/// of the sample, `E` takes the next word after the last pair.
#[inline(always)]
pub fn sample_ball<const N: usize>(
    stream: Stream,
    first: u64,
    varies: impl Fn(usize) -> bool,
    x: &mut [Lanes<N>],
) {
    let one = Lanes::<N>::lit(1.0);
    let zero = Lanes::<N>::lit(0.0);
    let pairs = x.len().div_ceil(2);
    let mut square = zero;
    let mut words = [[0; N]; 4];
    for pair in 0..=pairs {
        let at = 2 * pair;
        if at % 4 == 0 {
            words = stream.words::<N>(first, (at / 4) as u32);
        }
        let magnitude = one - unit(words[at % 4]);
        if pair == pairs {
            square = square - Lanes::lit(2.0) * magnitude.ln_unit();
            break;
        }
        let both = normal_pair(magnitude, unit(words[at % 4 + 1]));
        for (i, z) in (at..x.len()).zip(both) {
            x[i] = zero;
            if varies(i) {
                x[i] = z;
                square = square + z * z;
            }
        }
    }
    let scale = one / square.sqrt();
    for z in x {
        *z = *z * scale;
    }
}
