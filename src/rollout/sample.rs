//! Random starts: every sample is a function of seed, stream and index, on every backend.

use super::philox::philox;
use crate::real::{Lanes, Real, per_lane};

/// Name of the generator, as certificates state it.
pub const GENERATOR: &str = "Philox4x32-10";

/// What random numbers are used for; each use of each purpose has a stream of its own.
///
/// Whoever draws has a number of their own: two that shared one would draw the same numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purpose(u8);

impl Purpose {
    /// Starts that a user asks for.
    pub const USER: Self = Self::numbered(9);
    /// Control noise of MPPI.
    pub const CONTROL_NOISE: Self = Self::numbered(13);

    /// The purpose with a number that nobody else has.
    pub const fn numbered(number: u8) -> Self {
        Self(number)
    }

    /// Its number.
    pub fn number(self) -> u32 {
        u32::from(self.0)
    }
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
        Self { seed, id: purpose.number() << 24 | number }
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
    /// [`crate::rollout::Region::Box`].
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
    pub(super) fn uniform_in<const N: usize>(
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
