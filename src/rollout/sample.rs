//! Random starts: every sample is a function of seed, stream and index, on every backend.

use std::array::from_fn;

use super::philox::philox;
use crate::error::{Error, Result};
use crate::real::{Lanes, Real, per_lane};

/// Name of the generator, as certificates state it.
pub const GENERATOR: &str = "Philox4x32-10";

/// What random numbers are used for; each use of each purpose has a stream of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Nominal starts of a pilot that fixes the shape of the deviation bound.
    PilotNominal = 1,
    /// Their perturbations.
    PilotPerturbation,
    /// Nominal starts of the deviation bound.
    DeviationNominal,
    /// Their perturbations.
    DeviationPerturbation,
    /// Nominal starts that estimate the certified set and its conditional failure.
    ConditionalNominal,
    /// Their perturbations.
    ConditionalPerturbation,
    /// Starts in the balls of local growth.
    Growth,
    /// Directions of the boundary search.
    Direction,
    /// Starts that a user asks for.
    User,
    /// Starts that a stored certificate is checked with.
    Check,
    /// Perturbations that a stored certificate is checked with.
    CheckPerturbation,
    /// The rollouts drawn in a report.
    Picture,
    /// Control noise of MPPI.
    ControlNoise,
    /// Starts of races.
    RaceStart,
    /// Weights and starts of benchmarks.
    Bench,
    /// Weights of networks before training.
    TrainWeight,
    /// Starts, and states, to train on.
    TrainStart,
    /// Which of the states to train on a batch takes.
    TrainChoice,
    /// First controls to train on.
    TrainControl,
    /// Starts that training is scored on and never sees.
    HeldOut,
    /// Noise on the controls that reinforcement learning tries.
    TrainNoise,
}

/// A sequence of random samples, addressed by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    seed: u64,
    id: u32,
}

impl Stream {
    /// The stream number `number` of a purpose; numbers count uses, up to 2^24.
    ///
    /// # Panics
    /// If `number` is 2^24 or more.
    pub fn new(seed: u64, purpose: Purpose, number: u32) -> Self {
        assert!(number < 1 << 24, "stream number {number} does not fit 24 bits");
        Self { seed, id: (purpose as u32) << 24 | number }
    }

    /// The generator's key: the seed's low and high word.
    pub fn key(&self) -> [u32; 2] {
        [self.seed as u32, (self.seed >> 32) as u32]
    }

    /// The counter's last word.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Four random words for each of the samples `first..first + N`; `block` numbers the blocks
    /// of one sample. Counter: index low, index high, block, stream id.
    #[inline(always)]
    pub fn words<const N: usize>(&self, first: u64, block: u32) -> [[u32; N]; 4] {
        let counter = [
            per_lane!(N, i => first.wrapping_add(i as u64) as u32),
            per_lane!(N, i => (first.wrapping_add(i as u64) >> 32) as u32),
            [block; N],
            [self.id; N],
        ];
        philox(counter, self.key())
    }

    /// The samples `first..first + N` of the uniform distribution in a box: those of
    /// [`Region::Box`], for any number of coordinates.
    ///
    /// # Panics
    /// If the corners have not the same number of coordinates.
    pub fn in_box<const N: usize>(&self, low: &[f32], high: &[f32], first: u64) -> Vec<Lanes<N>> {
        assert_eq!(low.len(), high.len(), "both corners have the same coordinates");
        let mut words = [[0; N]; 4];
        let coordinate = |i: usize| {
            if i.is_multiple_of(4) {
                words = self.words(first, (i / 4) as u32);
            }
            Lanes::lit(low[i]) + unit(words[i % 4]) * Lanes::lit(high[i] - low[i])
        };
        (0..low.len()).map(coordinate).collect()
    }

    /// `count` independent standard normal numbers of the sample `index`.
    pub fn normals(&self, index: u64, count: usize) -> Vec<f32> {
        let pair = |pair: usize| {
            let words = self.words::<1>(index, (pair / 2) as u32);
            let [magnitude, turn] = [0, 1].map(|i| unit(words[2 * (pair % 2) + i]));
            normal_pair(Lanes::lit(1.0) - magnitude, turn).map(|lane| lane.0[0])
        };
        (0..count.div_ceil(2)).flat_map(pair).take(count).collect()
    }

    /// Number `word` of the uniform draws in `[0, 1)` of each sample `first..first + N`.
    ///
    /// 23 bits, exactly representable: the bits do not depend on the device.
    #[inline(always)]
    fn uniforms<const N: usize, const K: usize>(&self, first: u64) -> [Lanes<N>; K] {
        let mut out = [Lanes([0.0; N]); K];
        for (block, four) in out.chunks_mut(4).enumerate() {
            let words = self.words::<N>(first, block as u32);
            for (lanes, word) in four.iter_mut().zip(words) {
                *lanes = unit(word);
            }
        }
        out
    }
}

/// Uniform numbers in `[0, 1)` from random words: the upper 23 bits become the mantissa.
#[inline(always)]
pub(super) fn unit<const N: usize>(words: [u32; N]) -> Lanes<N> {
    Lanes(per_lane!(N, i => f32::from_bits(words[i] >> 9 | 0x3f80_0000) - 1.0))
}

/// Two independent standard normal numbers from uniforms in `(0, 1]` and `[0, 1)` (Box and
/// Muller 1958), in + - * / and sqrt alone; recorded for the shaders like physics. In f32 within
/// 3e-6 of the same two uniforms taken in f64, over all magnitudes that there are.
#[inline(always)]
pub fn normal_pair<R: Real>(magnitude: R, turn: R) -> [R; 2] {
    let radius = (R::lit(-2.0) * magnitude.ln_unit()).sqrt();
    let angle = R::lit(std::f32::consts::TAU) * (turn - R::lit(0.5));
    let [sin, cos] = angle.principal_sin_cos();
    [radius * cos, radius * sin]
}

/// A set of states with the uniform distribution on it.
#[derive(Clone, Debug, PartialEq)]
pub enum Region<const NX: usize> {
    /// An axis-parallel box.
    Box {
        /// Lower corner.
        low: [f32; NX],
        /// Upper corner; a coordinate with `low == high` is frozen.
        high: [f32; NX],
    },
    /// A Euclidean ball in some coordinates, the others frozen.
    Ball(Ball<NX>),
}

/// A Euclidean ball in the coordinates that are not frozen.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball<const NX: usize> {
    /// Centre; also the value of the frozen coordinates.
    pub center: [f32; NX],
    /// Radius.
    pub radius: f32,
    /// Whether each coordinate varies.
    pub varies: [bool; NX],
}

impl<const NX: usize> Ball<NX> {
    /// Number of coordinates that vary.
    pub fn dimension(&self) -> usize {
        self.varies.iter().filter(|varies| **varies).count()
    }

    /// Distance of `x` from the centre in the coordinates that vary.
    pub fn distance(&self, x: &[f32; NX]) -> f64 {
        let square = |i: usize| (f64::from(x[i]) - f64::from(self.center[i])).powi(2);
        (0..NX).filter(|&i| self.varies[i]).map(square).sum::<f64>().sqrt()
    }

    /// Whether `x` lies in the ball, its frozen coordinates equal to the centre's.
    pub fn contains(&self, x: &[f32; NX]) -> bool {
        let frozen = (0..NX).all(|i| self.varies[i] || x[i] == self.center[i]);
        frozen && self.distance(x) <= f64::from(self.radius)
    }
}

impl<const NX: usize> Region<NX> {
    /// A box, checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a bound is not finite, `low > high`, or no coordinate varies.
    pub fn new_box(low: [f32; NX], high: [f32; NX]) -> Result<Self> {
        let place = "box";
        for i in 0..NX {
            if !(low[i].is_finite() && high[i].is_finite() && low[i] <= high[i]) {
                let problem =
                    format!("coordinate {i} has the empty interval [{}, {}]", low[i], high[i]);
                return Err(Error::invalid(place, problem));
            }
        }
        if low == high {
            return Err(Error::invalid(place, "empty: low equals high in every coordinate"));
        }
        Ok(Self::Box { low, high })
    }

    /// Whether each coordinate varies.
    pub fn varies(&self) -> [bool; NX] {
        match self {
            Self::Box { low, high } => from_fn(|i| low[i] < high[i]),
            Self::Ball(ball) => ball.varies,
        }
    }

    /// Volume in the coordinates that vary.
    pub fn volume(&self) -> f64 {
        match self {
            Self::Box { low, high } => {
                let widths = (0..NX).map(|i| f64::from(high[i]) - f64::from(low[i]));
                widths.filter(|width| *width > 0.0).product()
            }
            Self::Ball(ball) => {
                // V_n = V_{n-2} 2 pi / n, from V_0 = 1 and V_1 = 2.
                let unit = |n: usize| {
                    let first = if n.is_multiple_of(2) { 1.0 } else { 2.0 };
                    let factors = (2..=n).filter(|k| k % 2 == n % 2);
                    factors.fold(first, |v, k| v * std::f64::consts::TAU / k as f64)
                };
                let dimension = ball.dimension();
                unit(dimension) * f64::from(ball.radius).powi(dimension as i32)
            }
        }
    }

    /// The samples `first..first + N` of the uniform distribution, one per lane.
    #[inline(always)]
    pub fn sample<const N: usize>(&self, stream: Stream, first: u64) -> [Lanes<N>; NX] {
        match self {
            Self::Box { low, high } => {
                let mut x = stream.uniforms::<N, NX>(first);
                for (i, x) in x.iter_mut().enumerate() {
                    *x = Lanes::lit(low[i]) + *x * Lanes::lit(high[i] - low[i]);
                }
                x
            }
            Self::Ball(ball) => {
                let mut x = sample_ball::<N, NX>(stream, first, &ball.varies);
                for (x, center) in x.iter_mut().zip(ball.center) {
                    *x = Lanes::lit(center) + Lanes::lit(ball.radius) * *x;
                }
                x
            }
        }
    }
}

/// Uniform offsets in the unit ball of the coordinates that vary, 0 in the others.
///
/// With `z` standard normal and `E` exponential, `z / sqrt(|z|^2 + 2 E)` is uniform in the ball
/// (Barthe, Guedon, Mendelson and Naor 2005): the distribution of a random direction times
/// `u^(1/n)`, without the root. Coordinates `2k` and `2k + 1` take the words `2k` and `2k + 1`
/// of the sample, `E` takes the next word after the last pair.
#[inline(always)]
pub fn sample_ball<const N: usize, const NX: usize>(
    stream: Stream,
    first: u64,
    varies: &[bool; NX],
) -> [Lanes<N>; NX] {
    let one = Lanes::<N>::lit(1.0);
    let zero = Lanes::<N>::lit(0.0);
    let pairs = NX.div_ceil(2);
    let mut normal = [zero; NX];
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
        for (i, z) in (at..NX).zip(both) {
            if varies[i] {
                normal[i] = z;
                square = square + z * z;
            }
        }
    }
    let scale = one / square.sqrt();
    for z in &mut normal {
        *z = *z * scale;
    }
    normal
}

/// Where the starts of a batch come from.
#[derive(Clone, Debug)]
pub enum Starts<'a, const NX: usize> {
    /// Drawn uniformly from a region.
    Drawn {
        /// The region.
        region: Region<NX>,
        /// The stream.
        stream: Stream,
    },
    /// Given one by one.
    Listed(&'a [[f32; NX]]),
}

impl<const NX: usize> Starts<'_, NX> {
    /// The starts `first..first + N`, one per lane; past the end of a list its last one.
    #[inline(always)]
    pub fn load<const N: usize>(&self, first: u64) -> [Lanes<N>; NX] {
        match self {
            Self::Drawn { region, stream } => region.sample(*stream, first),
            Self::Listed(list) => {
                let mut x = [Lanes([0.0; N]); NX];
                for i in 0..N {
                    let row = &list[(first as usize + i).min(list.len() - 1)];
                    for (x, value) in x.iter_mut().zip(row) {
                        x.0[i] = *value;
                    }
                }
                x
            }
        }
    }

    /// The start number `index`.
    pub fn start(&self, index: u64) -> [f32; NX] {
        self.load::<1>(index).map(|lane| lane.0[0])
    }
}

/// Pairs of a nominal and a perturbed start, `docs/method.md` section 3.
#[derive(Clone, Debug)]
pub struct Pairs<'a, const NX: usize> {
    /// Nominal starts.
    pub nominal: Starts<'a, NX>,
    /// Radius of the ball around each nominal start.
    pub radius: f32,
    /// Stream of the perturbations.
    pub stream: Stream,
}

impl<const NX: usize> Pairs<'_, NX> {
    /// The pairs `first..first + N`: nominal, then perturbed.
    #[inline(always)]
    pub fn load<const N: usize>(&self, first: u64) -> [[Lanes<N>; NX]; 2] {
        let nominal = self.nominal.load::<N>(first);
        let mut perturbed = sample_ball::<N, NX>(self.stream, first, &[true; NX]);
        for (x, nominal) in perturbed.iter_mut().zip(&nominal) {
            *x = *nominal + Lanes::lit(self.radius) * *x;
        }
        [nominal, perturbed]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_close_to_those_in_f64() {
        // A large magnitude is a small radius: from the smallest uniform to 1, and all turns.
        let grid = |count: u32| (1..=count).map(move |i| i as f32 / count as f32);
        let magnitudes = grid(2000).chain((0..24).map(|i| (-(i as f32)).exp2()));
        let mut worst = 0.0_f64;
        for magnitude in magnitudes {
            for turn in grid(500).map(|turn| turn - 1.0 / 500.0) {
                let ours = normal_pair(magnitude, turn);
                let truth = normal_pair(f64::from(magnitude), f64::from(turn));
                let error = |i: usize| (f64::from(ours[i]) - truth[i]).abs();
                worst = worst.max(error(0)).max(error(1));
            }
        }
        assert!(worst < 3e-6, "{worst}");
    }
}
