//! Upper bounds of spectral norms that hold in spite of rounding.

use nalgebra::DMatrix;

/// Squarings; the bound is above the norm by at most the factor `n^(1 / 2^(SQUARINGS + 1))`, less
/// than 1.0001 for a layer of 512.
const SQUARINGS: u32 = 16;

/// Most multiplications of a bound: some seconds of work, for a square layer of 1,024.
const MOST_PRODUCTS: f64 = (1_u64 << 34) as f64;

/// An upper bound of the spectral norm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NormBound {
    pub(super) bound: f64,
    /// Whether it is that of the sums of squares and of magnitudes alone, as the layer is too wide for another.
    pub(super) is_rough: bool,
}

/// An upper bound of the spectral norm of the matrix `weight`, `[rows, columns]` row by row.
pub(super) fn norm_bound(weight: &[f32], [rows, columns]: [usize; 2]) -> NormBound {
    let [long, short] = [rows.max(columns) as f64, rows.min(columns) as f64];
    let products = short * short * (long + short * f64::from(SQUARINGS));
    match products > MOST_PRODUCTS {
        true => NormBound { bound: rough_bound(weight, columns), is_rough: true },
        false => NormBound { bound: squared_bound(weight, [rows, columns]), is_rough: false },
    }
}

/// The Frobenius norm, or the root of the largest sums of magnitudes in a row and in a column: what is less.
fn rough_bound(weight: &[f32], columns: usize) -> f64 {
    let mut by_column = vec![0.0_f64; columns];
    let (mut squares, mut of_rows) = (0.0_f64, 0.0_f64);
    for row in weight.chunks_exact(columns) {
        let mut of_row = 0.0_f64;
        for (sum, &weight) in by_column.iter_mut().zip(row) {
            let size = f64::from(weight).abs();
            *sum += size;
            of_row += size;
            squares += size * size;
        }
        of_rows = of_rows.max(of_row);
    }
    let of_columns = by_column.into_iter().fold(0.0, f64::max);
    // Squares of the least f32 do not underflow in f64.
    let product = above(of_rows * of_columns, 2 * weight.len());
    above(above(squares, weight.len()).min(product).sqrt(), 1)
}

/// The bound by squares of the matrix.
///
/// The norm of `A` is at most the root of the sum of its squares, which is rough: up to `sqrt(n)`
/// times the norm. But `|A|^2 = |A'A|`, so a rough bound of `A'A` gives a better one of `A`, with
/// the root of the factor, and so on. Each product is computed with an error of its own, which is
/// at most `m u |A|_F^2` for rows of m sums and unit roundoff u in any order of summation (Higham
/// 2002, section 3.5), and is added before the root is taken.
fn squared_bound(weight: &[f32], [rows, columns]: [usize; 2]) -> f64 {
    let matrix = DMatrix::from_row_iterator(rows, columns, weight.iter().map(|&w| f64::from(w)));
    // The transpose has the same norm, and the smaller product.
    bound(if rows < columns { matrix.transpose() } else { matrix }, SQUARINGS)
}

/// The bound after so many squarings.
fn bound(matrix: DMatrix<f64>, squarings: u32) -> f64 {
    let frobenius = above(matrix.norm(), matrix.len());
    if squarings == 0 || frobenius == 0.0 {
        return frobenius;
    }
    // By a power of two, so that nothing is rounded and no square overflows.
    let scale = 2.0_f64.powi(frobenius.log2().floor() as i32);
    let scaled = matrix / scale;
    // Twice the error of the product: the rest covers what underflows.
    let error = scaled.nrows() as f64 * f64::EPSILON * (frobenius / scale).powi(2);
    let square = bound(scaled.tr_mul(&scaled), squarings - 1);
    above((square + above(error, 2)).sqrt(), 2) * scale
}

/// `value`, computed with so many roundings of non-negative numbers, rounded up.
fn above(value: f64, roundings: usize) -> f64 {
    value * (1.0 + (roundings + 2) as f64 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::{NormBound, norm_bound, rough_bound};
    use nalgebra::DMatrix;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};

    /// The bound is not below the norm that a decomposition finds, and close to it.
    fn check(matrix: &DMatrix<f32>) {
        let (rows, columns) = matrix.shape();
        let weight: Vec<f32> = matrix.transpose().as_slice().to_vec();
        let NormBound { bound, is_rough } = norm_bound(&weight, [rows, columns]);
        assert!(!is_rough);
        let norm = matrix.map(f64::from).singular_values().max();
        assert!(bound >= norm * (1.0 - 1e-14), "{rows} x {columns}: {bound} < {norm}");
        assert!(bound <= norm * 1.0001, "{rows} x {columns}: {bound} is far above {norm}");
    }

    fn random(rows: usize, columns: usize, draw: &mut StdRng) -> DMatrix<f32> {
        DMatrix::from_fn(rows, columns, |_, _| draw.random_range(-1.0..1.0))
    }

    #[test]
    fn the_bound_is_the_norm_rounded_up() {
        let mut draw = StdRng::seed_from_u64(1);
        for (rows, columns) in [(1, 1), (3, 8), (8, 3), (64, 12), (64, 64), (200, 150)] {
            let matrix = random(rows, columns, &mut draw);
            check(&matrix);
            check(&(&matrix * 1e-30));
            check(&(&matrix * 1e30));
            // One large singular value, and all but one of them zero.
            check(&(random(rows, 1, &mut draw) * random(1, columns, &mut draw)));
        }
    }

    #[test]
    fn a_wide_layer_has_a_rough_bound_at_once() {
        let bound = norm_bound(&vec![0.5; 3000 * 3000], [3000, 3000]);
        assert!(bound.is_rough);
        assert!((1500.0..1500.001).contains(&bound.bound), "{bound:?}");
        let mut draw = StdRng::seed_from_u64(2);
        for (rows, columns) in [(1, 1), (3, 8), (8, 3), (64, 12), (64, 64)] {
            let matrix = random(rows, columns, &mut draw);
            let weight: Vec<f32> = matrix.transpose().as_slice().to_vec();
            let norm = matrix.map(f64::from).singular_values().max();
            let rough = rough_bound(&weight, columns);
            assert!(rough >= norm * (1.0 - 1e-14), "{rough} < {norm}");
            assert!(rough <= norm * 8.1);
        }
        assert!(rough_bound(&[f32::MAX; 4], 2) >= 2.0 * f64::from(f32::MAX));
        assert!(rough_bound(&[1e-45], 1) >= f64::from(1e-45_f32));
    }

    #[test]
    fn known_norms() {
        let all_equal = DMatrix::<f32>::identity(100, 100);
        check(&all_equal);
        // A Hadamard matrix: every singular value is the root of its size.
        let sign =
            |i: usize, j: usize| if (i & j).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        let hadamard = DMatrix::from_fn(64, 64, sign);
        let of = |weight: &[f32], shape| norm_bound(weight, shape).bound;
        let bound = of(hadamard.as_slice(), [64, 64]);
        assert!((8.0..8.001).contains(&bound), "{bound}");
        assert_eq!(of(&[0.0; 6], [2, 3]), 0.0);
        assert!(of(&[f32::MAX; 4], [2, 2]) >= 2.0 * f64::from(f32::MAX));
        assert!(of(&[1e-45], [1, 1]) >= f64::from(1e-45_f32));
    }
}
