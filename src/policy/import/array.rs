//! Arrays of constants in a graph, and what operations make of them before anything runs.

/// Most numbers of an array that is made of others, which the size of a file does not bound.
const MOST: usize = 1 << 24;

/// An array in f64, its last index the fastest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// Length of each dimension.
    pub(super) shape: Vec<usize>,
    /// As many as the product of the lengths.
    pub(super) numbers: Vec<f64>,
    /// Whether they are integers, whose quotients are, too.
    pub(super) whole: bool,
}

impl Array {
    /// These numbers, if they fill the shape.
    pub(super) fn new(shape: Vec<usize>, numbers: &[f64]) -> Option<Self> {
        let fills = shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length))
            == Some(numbers.len());
        fills.then(|| Self { shape, numbers: numbers.to_vec(), whole: false })
    }

    /// The same numbers, if they fill this shape.
    pub(super) fn filling(&self, shape: Vec<usize>) -> Option<Self> {
        Self::new(shape, &self.numbers).map(|array| array.integers(self.whole))
    }

    /// One number.
    pub(super) fn number(number: f64) -> Self {
        Self { shape: Vec::new(), numbers: vec![number], whole: false }
    }

    /// A list of numbers.
    pub(super) fn list(numbers: Vec<f64>) -> Self {
        Self { shape: vec![numbers.len()], numbers, whole: false }
    }

    /// The same as integers.
    pub(super) fn integers(self, whole: bool) -> Self {
        Self { whole, ..self }
    }

    /// The number that all of its numbers are, if they are one.
    pub(super) fn uniform(&self) -> Option<f64> {
        let first = *self.numbers.first()?;
        self.numbers.iter().all(|number| *number == first).then_some(first)
    }

    /// Its numbers as whole ones.
    pub(super) fn wholes(&self) -> Vec<i64> {
        self.numbers.iter().map(|&number| number as i64).collect()
    }

    /// The same with each number changed.
    pub(super) fn each(&self, f: impl Fn(f64) -> f64) -> Self {
        let numbers = self.numbers.iter().map(|&x| f(x)).collect();
        Self { shape: self.shape.clone(), numbers, whole: self.whole }
    }

    /// `f` of its numbers and those of `other`, each as often as the shapes ask for.
    pub(super) fn with(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Option<Self> {
        let rank = self.shape.len().max(other.shape.len());
        let length = |array: &Self, i: usize| match (i + array.shape.len()).checked_sub(rank) {
            Some(i) => array.shape[i],
            None => 1,
        };
        let joint = |i: usize| match (length(self, i), length(other, i)) {
            (a, b) if a == b => Some(a),
            (1, b) => Some(b),
            (a, 1) => Some(a),
            _ => None,
        };
        let shape = (0..rank).map(joint).collect::<Option<Vec<usize>>>()?;
        let count = shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length))?;
        if count > MOST {
            return None;
        }
        let place = |array: &Self, mut at: usize| {
            let (mut place, mut step) = (0, 1);
            for i in (0..rank).rev() {
                let own = length(array, i);
                place += if own == 1 { 0 } else { (at % shape[i]) * step };
                step *= own;
                at /= shape[i];
            }
            array.numbers[place]
        };
        let numbers = (0..count).map(|at| f(place(self, at), place(other, at))).collect();
        Some(Self { shape, numbers, whole: self.whole && other.whole })
    }

    /// The same numbers in another shape, in which -1 is what is left and 0 what was there.
    pub(super) fn reshaped(&self, wanted: &[i64]) -> Option<Self> {
        let kept = |(i, &length): (usize, &i64)| match length {
            0 => self.shape.get(i).copied(),
            -1 => Some(1),
            _ => usize::try_from(length).ok(),
        };
        let mut shape = wanted.iter().enumerate().map(kept).collect::<Option<Vec<usize>>>()?;
        if let Some(free) = wanted.iter().position(|&length| length == -1) {
            let rest = shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length))?;
            shape[free] = self.numbers.len().checked_div(rest)?;
        }
        self.filling(shape)
    }

    /// The same with its dimensions in another order; turned around if none is given.
    pub(super) fn transposed(&self, order: Option<&[i64]>) -> Option<Self> {
        let rank = self.shape.len();
        let order: Vec<usize> = match order {
            None => (0..rank).rev().collect(),
            Some(order) => order.iter().map(|&i| usize::try_from(i).ok()).collect::<Option<_>>()?,
        };
        let mut sorted = order.clone();
        sorted.sort_unstable();
        if !sorted.iter().copied().eq(0..rank) {
            return None;
        }
        let stride = |i: usize| self.shape[i + 1..].iter().product::<usize>();
        let shape: Vec<usize> = order.iter().map(|&i| self.shape[i]).collect();
        let places = order.iter().fold(vec![0], |places: Vec<usize>, &i| {
            let row = |place: usize| (0..self.shape[i]).map(move |j| place + j * stride(i));
            places.into_iter().flat_map(row).collect()
        });
        let numbers = places.into_iter().map(|place| self.numbers[place]).collect();
        Some(Self { shape, numbers, whole: self.whole })
    }
}
