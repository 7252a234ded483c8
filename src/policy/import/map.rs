//! Maps of each number on its own, `clamp(scale x + shift, low, high)`, and what two in a row are.

/// A map of so many numbers, in f64.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// Factors.
    pub(super) scale: Vec<f64>,
    /// What is added then.
    pub(super) shift: Vec<f64>,
    /// Lower limits, `-inf` where there is none.
    pub(super) low: Vec<f64>,
    /// Upper limits, `inf` where there is none.
    pub(super) high: Vec<f64>,
}

impl Map {
    /// `scale x + shift`.
    pub(super) fn affine(scale: Vec<f64>, shift: Vec<f64>) -> Self {
        let width = scale.len();
        Self { scale, shift, low: vec![f64::NEG_INFINITY; width], high: vec![f64::INFINITY; width] }
    }

    /// What changes none of `width` numbers.
    pub(super) fn nothing(width: usize) -> Self {
        Self::affine(vec![1.0; width], vec![0.0; width])
    }

    /// `(x - mean) / deviation`.
    pub(super) fn normal(mean: &[f64], deviation: &[f64]) -> Self {
        let shift = mean.iter().zip(deviation).map(|(mean, deviation)| -mean / deviation);
        Self::affine(deviation.iter().map(|deviation| 1.0 / deviation).collect(), shift.collect())
    }

    /// `clamp(x, low, high)`.
    pub(super) fn clamp(mut low: Vec<f64>, high: Vec<f64>) -> Self {
        let width = low.len();
        // The upper limit is the last word where they are the wrong way around.
        low.iter_mut().zip(&high).for_each(|(low, high)| *low = low.min(*high));
        Self { low, high, ..Self::nothing(width) }
    }

    /// The same map of `width` numbers, where it is one of a single number.
    pub(super) fn widened(&self, width: usize) -> Self {
        let each = |values: &[f64]| match values {
            [one] => vec![*one; width],
            several => several.to_vec(),
        };
        let Self { scale, shift, low, high } = self;
        Self { scale: each(scale), shift: each(shift), low: each(low), high: each(high) }
    }

    /// The maps of several parts as that of all.
    pub(super) fn joined(parts: &[Self]) -> Self {
        let all = |of: fn(&Self) -> &[f64]| parts.iter().flat_map(of).copied().collect();
        Self {
            scale: all(|part| &part.scale),
            shift: all(|part| &part.shift),
            low: all(|part| &part.low),
            high: all(|part| &part.high),
        }
    }

    /// The map of these of its numbers.
    pub(super) fn selected(&self, rows: &[usize]) -> Self {
        let some = |values: &[f64]| rows.iter().map(|&row| values[row]).collect();
        let Self { scale, shift, low, high } = self;
        Self { scale: some(scale), shift: some(shift), low: some(low), high: some(high) }
    }

    /// The map of `width` numbers that does this to those at `places`, and nothing to the others.
    pub(super) fn scattered(&self, places: &[usize], width: usize) -> Self {
        let spread = |values: &[f64], nothing: f64| {
            let mut all = vec![nothing; width];
            places.iter().zip(values).for_each(|(&place, &value)| all[place] = value);
            all
        };
        let Self { scale, shift, low, high } = self;
        Self {
            scale: spread(scale, 1.0),
            shift: spread(shift, 0.0),
            low: spread(low, f64::NEG_INFINITY),
            high: spread(high, f64::INFINITY),
        }
    }

    /// How many numbers it takes.
    pub(super) fn width(&self) -> usize {
        self.scale.len()
    }

    /// Whether it has no limits.
    pub(super) fn is_affine(&self) -> bool {
        let ends = self.low.iter().zip(&self.high);
        ends.into_iter().all(|ends| ends == (&f64::NEG_INFINITY, &f64::INFINITY))
    }

    /// Whether it changes nothing.
    pub(super) fn is_identity(&self) -> bool {
        let plain = self.scale.iter().all(|&s| s == 1.0) && self.shift.iter().all(|&t| t == 0.0);
        plain && self.is_affine()
    }

    /// The map without its limits, and these, where all numbers have the same.
    pub(super) fn parts(&self) -> (Self, Option<[f64; 2]>) {
        let affine = Self::affine(self.scale.clone(), self.shift.clone());
        let same = |values: &[f64]| values.iter().all(|value| *value == values[0]);
        let limits = (same(&self.low) && same(&self.high)).then(|| [self.low[0], self.high[0]]);
        (affine, limits)
    }

    /// `next` after this map.
    pub(super) fn then(&self, next: &Self) -> Self {
        let each = |i: usize| {
            let (scale, shift) = (next.scale[i], next.shift[i]);
            // What is 0 times anything has no limits left.
            let [a, b] = match scale {
                0.0 => [f64::NEG_INFINITY, f64::INFINITY],
                _ => [self.low[i], self.high[i]].map(|end| scale * end + shift),
            };
            let within = |value: f64| value.max(next.low[i]).min(next.high[i]);
            [
                scale * self.scale[i],
                scale * self.shift[i] + shift,
                within(a.min(b)),
                within(a.max(b)),
            ]
        };
        let all: Vec<[f64; 4]> = (0..self.width()).map(each).collect();
        let column = |j: usize| all.iter().map(|row| row[j]).collect();
        Self { scale: column(0), shift: column(1), low: column(2), high: column(3) }
    }
}
