//! Numbers that fill one register: what formulas are evaluated in where their speed counts.

use super::{Lanes, Real, per_lane};

/// `WIDTH` f32 numbers that go through the same formula side by side.
///
/// The bits are those of [`Lanes`], whatever the instructions. Lanes leave it to the compiler to
/// find the vectors, which it does for short formulas; a vector is one from the start, and a state
/// of a dozen of them stays in the registers.
pub(crate) trait Vector: Real {
    /// Numbers of a vector.
    const WIDTH: usize;

    /// The first `WIDTH` of `numbers`.
    ///
    /// # Panics
    /// If there are fewer.
    fn load(numbers: &[f32]) -> Self;

    /// Writes the numbers to the first `WIDTH` of `numbers`.
    ///
    /// # Panics
    /// If there are fewer.
    fn store(self, numbers: &mut [f32]);

    /// Each number as `one` makes it.
    fn each(self, one: impl Fn(f32) -> f32) -> Self;
}

impl<const N: usize> Vector for Lanes<N> {
    const WIDTH: usize = N;

    #[inline(always)]
    fn load(numbers: &[f32]) -> Self {
        let mut lanes = [0.0; N];
        lanes.copy_from_slice(&numbers[..N]);
        Self(lanes)
    }

    #[inline(always)]
    fn store(self, numbers: &mut [f32]) {
        numbers[..N].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn each(self, one: impl Fn(f32) -> f32) -> Self {
        Self(per_lane!(N, i => one(self.0[i])))
    }
}

/// The vectors of the rows `rows` from number `at` on.
#[inline(always)]
pub(crate) fn load_rows<V: Vector, const N: usize, const R: usize>(
    rows: &[Lanes<N>; R],
    at: usize,
) -> [V; R] {
    let mut vectors = [V::lit(0.0); R];
    for (vector, row) in vectors.iter_mut().zip(rows) {
        *vector = V::load(&row.0[at..]);
    }
    vectors
}

/// Writes `vectors` to the rows `rows` from number `at` on.
#[inline(always)]
pub(crate) fn store_rows<V: Vector, const N: usize, const R: usize>(
    vectors: [V; R],
    rows: &mut [Lanes<N>; R],
    at: usize,
) {
    for (vector, row) in vectors.into_iter().zip(rows) {
        vector.store(&mut row.0[at..]);
    }
}
