//! Random starts: every sample is a function of seed, stream and index, on every backend.

use super::philox::philox;
use crate::error::{Error, Result};
use crate::files::States;
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
    /// [`Region::Box`].
    ///
    /// # Panics
    /// If the corners have not the same number of coordinates.
    pub fn in_box<const N: usize>(&self, low: &[f32], high: &[f32], first: u64) -> Vec<Lanes<N>> {
        assert_eq!(low.len(), high.len(), "both corners have the same coordinates");
        let mut x = vec![Lanes([0.0; N]); low.len()];
        self.uniform_in(low, high, first, &mut x);
        x
    }

    /// The same, written to a row for each coordinate.
    #[inline(always)]
    fn uniform_in<const N: usize>(
        &self,
        low: &[f32],
        high: &[f32],
        first: u64,
        x: &mut [Lanes<N>],
    ) {
        self.uniforms(first, x);
        for (x, (low, high)) in x.iter_mut().zip(low.iter().zip(high)) {
            *x = Lanes::lit(*low) + *x * Lanes::lit(high - low);
        }
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

    /// Uniform draws in `[0, 1)` of the samples `first..first + N`, a number for each of `out`.
    ///
    /// 23 bits, exactly representable: the bits do not depend on the device.
    #[inline(always)]
    fn uniforms<const N: usize>(&self, first: u64, out: &mut [Lanes<N>]) {
        for (block, four) in out.chunks_mut(4).enumerate() {
            let words = self.words::<N>(first, block as u32);
            for (lanes, word) in four.iter_mut().zip(words) {
                *lanes = unit(word);
            }
        }
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
        }
    }

    /// Whether each coordinate varies.
    pub fn varies(&self) -> Vec<bool> {
        match self {
            Self::Box { low, high } => low.iter().zip(high).map(|(low, high)| low < high).collect(),
            Self::Ball(ball) => ball.varies.clone(),
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
        }
    }

    /// The sample number `index`.
    pub fn point(&self, stream: Stream, index: u64) -> Vec<f32> {
        let mut x = vec![Lanes([0.0]); self.size()];
        self.sample::<1>(stream, index, &mut x);
        x.into_iter().map(|lane| lane.0[0]).collect()
    }
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

/// Where the starts of a batch come from.
#[derive(Clone, Debug)]
pub enum Starts<'a> {
    /// Drawn uniformly from a region.
    Drawn {
        /// The region.
        region: Region,
        /// The stream.
        stream: Stream,
    },
    /// Given one by one.
    Listed(States<'a>),
}

impl<'a> Starts<'a> {
    /// The starts of a list.
    pub fn listed(list: impl Into<States<'a>>) -> Self {
        Self::Listed(list.into())
    }

    /// Numbers of a start.
    pub fn size(&self) -> usize {
        match self {
            Self::Drawn { region, .. } => region.size(),
            Self::Listed(list) => list.size(),
        }
    }

    /// The starts `first..first + N`, one per lane, past the end of a list its last one; `x` has a
    /// row for each coordinate.
    #[inline(always)]
    pub fn load<const N: usize>(&self, first: u64, x: &mut [Lanes<N>]) {
        match self {
            Self::Drawn { region, stream } => region.sample(*stream, first, x),
            Self::Listed(list) => {
                for i in 0..N {
                    let row = list.row((first as usize + i).min(list.len() - 1));
                    for (x, value) in x.iter_mut().zip(row) {
                        x.0[i] = *value;
                    }
                }
            }
        }
    }

    /// The start number `index`.
    pub fn start(&self, index: u64) -> Vec<f32> {
        let mut x = vec![Lanes([0.0]); self.size()];
        self.load::<1>(index, &mut x);
        x.into_iter().map(|lane| lane.0[0]).collect()
    }

    /// The start number `index`, of `NX` numbers.
    ///
    /// # Panics
    /// If a start has fewer.
    pub fn start_array<const NX: usize>(&self, index: u64) -> [f32; NX] {
        let start = self.start(index);
        std::array::from_fn(|i| start[i])
    }
}

/// Pairs of a nominal and a perturbed start, `docs/method.md` section 3.
#[derive(Clone, Debug)]
pub struct Pairs<'a> {
    /// Nominal starts.
    pub nominal: Starts<'a>,
    /// Radius of the ball around each nominal start.
    pub radius: f32,
    /// Stream of the perturbations.
    pub stream: Stream,
}

impl Pairs<'_> {
    /// The pairs `first..first + N`: rows of the nominal starts, then of the perturbed ones.
    #[inline(always)]
    pub fn load<const N: usize>(
        &self,
        first: u64,
        nominal: &mut [Lanes<N>],
        perturbed: &mut [Lanes<N>],
    ) {
        self.nominal.load(first, nominal);
        sample_ball(self.stream, first, |_| true, perturbed);
        for (x, nominal) in perturbed.iter_mut().zip(nominal) {
            *x = *nominal + Lanes::lit(self.radius) * *x;
        }
    }

    /// The pair number `index`: nominal, then perturbed.
    pub fn pair(&self, index: u64) -> [Vec<f32>; 2] {
        let mut rows = [(); 2].map(|()| vec![Lanes([0.0]); self.nominal.size()]);
        let [nominal, perturbed] = &mut rows;
        self.load::<1>(index, nominal, perturbed);
        rows.map(|rows| rows.into_iter().map(|lane| lane.0[0]).collect())
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
