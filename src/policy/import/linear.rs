//! Linear layers in f64: products of them, and maps folded into them.

use super::map::Map;

/// Most weights of a product of layers, which is not bounded by the size of a file.
const MOST_WEIGHTS: usize = 1 << 24;

/// `y = W x + b`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Linear {
    /// `W`, `[outputs, inputs]` row by row.
    pub(super) weight: Vec<f64>,
    /// `b`, `[outputs]`.
    pub(super) bias: Vec<f64>,
    /// Columns of `W`, at least one.
    pub(super) inputs: usize,
}

/// Some of the inputs, each mapped by itself.
pub(super) struct Chosen {
    /// Which of them.
    pub(super) places: Vec<usize>,
    /// Of each.
    pub(super) map: Map,
}

impl Linear {
    /// `y = W x` with rows of `inputs` weights, at least one.
    pub(super) fn new(weight: Vec<f64>, inputs: usize) -> Self {
        Self { bias: vec![0.0; weight.len() / inputs], weight, inputs }
    }

    /// `y = W x` of weights that lie as `[inputs, outputs]`.
    pub(super) fn transposed(weight: &[f64], [inputs, outputs]: [usize; 2]) -> Self {
        let row = |output: usize| weight[output..].iter().step_by(outputs);
        Self::new((0..outputs).flat_map(row).copied().collect(), inputs)
    }

    /// The map `scale x + shift` as a layer.
    pub(super) fn diagonal(map: &Map) -> Result<Self, String> {
        let width = map.width();
        room(width, width)?;
        let mut weight = vec![0.0; width * width];
        for (i, &scale) in map.scale.iter().enumerate() {
            weight[i * width + i] = scale;
        }
        Ok(Self { weight, bias: map.shift.clone(), inputs: width })
    }

    /// These of `inputs` numbers, in this order.
    pub(super) fn selection(rows: &[usize], inputs: usize) -> Self {
        let mut weight = vec![0.0; rows.len() * inputs];
        rows.iter().enumerate().for_each(|(i, &row)| weight[i * inputs + row] = 1.0);
        Self::new(weight, inputs)
    }

    /// Whether each output is one of the inputs at most, mapped by itself.
    pub(super) fn is_choice(&self) -> bool {
        self.rows().all(|row| row.iter().filter(|weight| **weight != 0.0).count() < 2)
    }

    /// The inputs that a layer of one weight at most in each row takes, and what it does with them.
    pub(super) fn chosen(&self) -> Chosen {
        let place = |row: &[f64]| row.iter().position(|weight| *weight != 0.0).unwrap_or(0);
        let places: Vec<usize> = self.rows().map(place).collect();
        let scale = self.rows().zip(&places).map(|(row, &place)| row[place]).collect();
        Chosen { map: Map::affine(scale, self.bias.clone()), places }
    }

    /// The largest weight of each input.
    pub(super) fn steepest(&self) -> Vec<f64> {
        let mut largest = vec![0.0; self.inputs];
        for row in self.rows() {
            largest
                .iter_mut()
                .zip(row)
                .for_each(|(most, w): (&mut f64, _)| *most = most.max(w.abs()));
        }
        largest
    }

    /// Rows of `W`.
    pub(super) fn outputs(&self) -> usize {
        self.bias.len()
    }

    /// The rows of `W`.
    pub(super) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.weight.chunks_exact(self.inputs)
    }

    /// These of its outputs alone.
    pub(super) fn selected(&self, rows: &[usize]) -> Self {
        let row = |&row: &usize| &self.weight[row * self.inputs..][..self.inputs];
        let weight = rows.iter().flat_map(row).copied().collect();
        Self { weight, bias: rows.iter().map(|&row| self.bias[row]).collect(), inputs: self.inputs }
    }

    /// `next` after this layer, as one.
    ///
    /// # Errors
    /// A sentence about widths that do not fit, or a product that is too large.
    pub(super) fn then(&self, next: &Self) -> Result<Self, String> {
        fits(self.outputs(), next.inputs)?;
        room(next.outputs(), self.inputs)?;
        let mut product = Self {
            weight: vec![0.0; next.outputs() * self.inputs],
            bias: next.bias.clone(),
            inputs: self.inputs,
        };
        let into = product.weight.chunks_exact_mut(self.inputs).zip(&mut product.bias);
        for ((row, bias), factors) in into.zip(next.rows()) {
            for ((mine, mine_bias), factor) in self.rows().zip(&self.bias).zip(factors) {
                *bias += factor * mine_bias;
                row.iter_mut().zip(mine).for_each(|(sum, weight)| *sum += factor * weight);
            }
        }
        Ok(product)
    }

    /// The map `scale y + shift` after this layer.
    ///
    /// # Errors
    /// A sentence about widths that do not fit.
    pub(super) fn scaled(&mut self, map: &Map) -> Result<(), String> {
        fits(self.outputs(), map.width())?;
        let rows = self.weight.chunks_exact_mut(self.inputs).zip(&mut self.bias);
        for ((row, bias), (scale, shift)) in rows.zip(map.scale.iter().zip(&map.shift)) {
            row.iter_mut().for_each(|weight| *weight *= scale);
            *bias = *bias * scale + shift;
        }
        Ok(())
    }

    /// This layer after the map `scale x + shift`.
    ///
    /// # Errors
    /// A sentence about widths that do not fit.
    pub(super) fn after(&mut self, map: &Map) -> Result<(), String> {
        fits(map.width(), self.inputs)?;
        for (row, bias) in self.weight.chunks_exact_mut(self.inputs).zip(&mut self.bias) {
            for ((weight, scale), shift) in row.iter_mut().zip(&map.scale).zip(&map.shift) {
                *bias += *weight * shift;
                *weight *= scale;
            }
        }
        Ok(())
    }

    /// Whether the layer after `map` has the same numbers in f32 as in f64: factors that are powers of two
    /// and nothing added.
    pub(super) fn is_exact_after(&self, map: &Map) -> bool {
        let exact = |value: f64| f64::from(value as f32) == value;
        let factors = |row: &[f64]| row.iter().zip(&map.scale).all(|(w, s)| exact(w * s));
        let power = |scale: &f64| scale.to_bits().trailing_zeros() >= f64::MANTISSA_DIGITS - 1;
        map.shift.iter().all(|&shift| shift == 0.0)
            && map.scale.iter().all(power)
            && self.rows().all(factors)
    }
}

/// Refuses a layer that takes another number of values than there are.
fn fits(have: usize, takes: usize) -> Result<(), String> {
    match have == takes {
        true => Ok(()),
        false => Err(format!("{have} numbers where the next operation takes {takes}")),
    }
}

/// Refuses a layer with too many weights.
fn room(outputs: usize, inputs: usize) -> Result<(), String> {
    match outputs.checked_mul(inputs) {
        Some(weights) if weights <= MOST_WEIGHTS => Ok(()),
        _ => Err(format!(
            "layers one after the other whose product has {outputs} x {inputs} weights; at most {MOST_WEIGHTS}"
        )),
    }
}
