//! The dimensions of a value of a graph: which counts inputs, and along which lie the numbers of one input.

use super::array::Array;

/// What a dimension counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Length {
    /// Inputs of the network, however many.
    Inputs,
    /// Numbers of one input; how many, where that is known.
    Numbers(Option<usize>),
}

/// One number, or a dimension that changes nothing.
const ONE: Length = Length::Numbers(Some(1));

/// The dimensions of a value, the last one the fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Form {
    lengths: Vec<Length>,
    /// So many numbers of one input, where these may be meant as well as so many inputs of one number.
    column: Option<usize>,
}

impl Form {
    /// That of an input of the graph, of which a length that is not known is not positive; inputs and their numbers
    /// if nothing is said.
    pub(super) fn of(lengths: Option<&[i64]>) -> Self {
        let numbers = |&length: &i64| usize::try_from(length).ok().filter(|length| *length > 0);
        let Some(stated) = lengths else {
            return Self { lengths: vec![Length::Inputs, Length::Numbers(None)], column: None };
        };
        let mut lengths: Vec<Length> =
            stated.iter().map(|length| Length::Numbers(numbers(length))).collect();
        let mut column = None;
        if let [first, rest @ ..] = lengths.as_mut_slice()
            && !rest.is_empty()
            && *first != ONE
        {
            column = numbers(&stated[0]).filter(|_| rest.iter().all(|length| *length == ONE));
            *first = Length::Inputs;
        }
        Self { lengths, column }
    }

    /// Numbers of one input, where they are known; `usize::MAX` if they are more.
    pub(super) fn width(&self) -> Option<usize> {
        let width = self.lengths.iter().try_fold(1, |width: usize, length| match length {
            Length::Inputs => Some(width),
            Length::Numbers(length) => length.map(|length| width.saturating_mul(length)),
        });
        width.filter(|_| self.column.is_none())
    }

    /// Its lengths as numbers, not a number for the inputs; nothing if one is not known.
    pub(super) fn sizes(&self) -> Option<Vec<f64>> {
        let size = |length: &Length| match length {
            Length::Inputs => Some(f64::NAN),
            Length::Numbers(length) => length.map(|length| length as f64),
        };
        let sizes = self.lengths.iter().map(size).collect::<Option<Vec<f64>>>();
        sizes.filter(|_| self.column.is_none())
    }

    /// How many dimensions there are.
    pub(super) fn rank(&self) -> usize {
        self.lengths.len()
    }

    /// The dimension that `axis` stands for, which counts from the end if it is negative.
    ///
    /// # Errors
    /// A sentence about one that is not there.
    pub(super) fn axis(&self, axis: i64) -> Result<usize, String> {
        let rank = self.rank() as i64;
        let from_start = usize::try_from(if axis < 0 { axis + rank } else { axis }).ok();
        from_start
            .filter(|axis| *axis < self.rank())
            .ok_or_else(|| format!("of dimension {axis} of a value that has {rank}"))
    }

    /// Refuses a dimension that is not the one in which all numbers of an input lie.
    pub(super) fn along(&self, axis: usize) -> Result<(), String> {
        let others =
            self.lengths.iter().enumerate().filter(|(i, _)| *i != axis).map(|(_, length)| *length);
        match self.lengths.get(axis) {
            Some(Length::Inputs) => Err("of the dimension that counts inputs".to_owned()),
            Some(_) if others.clone().all(|length| matches!(length, ONE | Length::Inputs)) => {
                Ok(())
            }
            _ => Err(format!("of one dimension of a value whose numbers lie in others, {self}")),
        }
    }

    /// The same with these lengths of numbers in the place of one dimension.
    pub(super) fn replaced(mut self, axis: usize, lengths: &[usize]) -> Self {
        let lengths = lengths.iter().map(|&length| Length::Numbers(Some(length)));
        drop(self.lengths.splice(axis..=axis, lengths));
        Self { column: None, ..self }
    }

    /// The same as numbers of one input, where that may be meant.
    pub(super) fn into_column(mut self) -> Self {
        if let Some(count) = self.column.take() {
            let numbers = Length::Numbers(Some(count));
            self.lengths.iter_mut().filter(|l| **l == Length::Inputs).for_each(|l| *l = numbers);
        }
        self
    }

    /// The same next to a constant, whose numbers may be as many or one.
    ///
    /// # Errors
    /// A sentence about a constant that makes more numbers of it, or goes along the inputs.
    pub(super) fn beside(self, constant: &Array) -> Result<Self, String> {
        let Array { shape, .. } = constant;
        let several = shape.iter().any(|&length| length != 1);
        let mut form = if several { self.into_column() } else { self };
        while form.rank() < shape.len() {
            form.lengths.insert(0, ONE);
        }
        let before = form.to_string();
        for (own, &length) in form.lengths.iter_mut().rev().zip(shape.iter().rev()) {
            match own {
                _ if length == 1 => {}
                Length::Numbers(Some(have)) if *have == length => {}
                Length::Numbers(have) if have.is_none() => *have = Some(length),
                _ => {
                    return Err(format!(
                        "with a constant of shape {shape:?}, which does not leave a value {before} as it is"
                    ));
                }
            }
        }
        Ok(form)
    }

    /// What is left of it by a kernel as large as one input.
    ///
    /// # Errors
    /// A sentence about other dimensions than those of the kernel.
    pub(super) fn convolved(self, kernel: &[usize]) -> Result<Self, String> {
        let [outputs, kernel @ ..] = kernel else { return Err("without a kernel".to_owned()) };
        let numbers = kernel.iter().map(|&length| Length::Numbers(Some(length)));
        let same = self.lengths.iter().skip(1).copied().eq(numbers);
        if !same || !matches!(self.lengths.first().copied(), Some(ONE | Length::Inputs)) {
            return Err(format!("of a value {self} with a kernel {kernel:?}"));
        }
        let left = self.lengths[..1].iter().copied().chain([Length::Numbers(Some(*outputs))]);
        let ones = kernel.iter().skip(1).map(|_| ONE);
        Ok(Self { lengths: left.chain(ones).collect(), column: None })
    }

    /// Two dimensions: those before `axis`, and the others.
    pub(super) fn flattened(self, axis: i64) -> Option<Self> {
        let rank = self.rank() as i64;
        let axis = usize::try_from(if axis < 0 { axis + rank } else { axis }).ok()?;
        if (axis, self.rank()) == (1, 2) {
            return Some(self);
        }
        let joint = |lengths: &[Length]| match lengths.iter().find(|l| **l == Length::Inputs) {
            Some(inputs) => {
                lengths.iter().all(|l| matches!(*l, ONE | Length::Inputs)).then_some(*inputs)
            }
            None => {
                let part = Self { lengths: lengths.to_vec(), column: None };
                Some(Length::Numbers(part.width()))
            }
        };
        let before = joint(self.lengths.get(..axis)?)?;
        let after = joint(self.lengths.get(axis..)?)?;
        let lengths = vec![before, after];
        Some(Self { lengths, column: self.column }).filter(Self::is_in_order)
    }

    /// Other lengths, in which -1 is what is left, 0 what was there, and what is no number the inputs.
    pub(super) fn reshaped(&self, wanted: &[f64]) -> Option<Self> {
        let rows = Self { column: None, ..self.clone() };
        rows.filled(wanted).or_else(|| self.clone().into_column().filled(wanted))
    }

    /// The same of a form that is clear.
    fn filled(&self, wanted: &[f64]) -> Option<Self> {
        let length = |(i, &length): (usize, &f64)| match length {
            _ if length.is_nan() => Some(Length::Inputs),
            0.0 => self.lengths.get(i).copied(),
            -1.0 => Some(ONE),
            _ if length >= 1.0 => Some(Length::Numbers(Some(length as usize))),
            _ => None,
        };
        let mut lengths = wanted.iter().enumerate().map(length).collect::<Option<Vec<Length>>>()?;
        let inputs = |lengths: &[Length]| lengths.iter().filter(|l| **l == Length::Inputs).count();
        if let Some(free) = wanted.iter().position(|&length| length == -1.0) {
            let rest = Self { lengths: lengths.clone(), column: None }.width();
            let marked = inputs(&lengths) == inputs(&self.lengths);
            lengths[free] = match (self.width(), rest) {
                (Some(width), rest) if !marked => {
                    (rest == Some(width)).then_some(Length::Inputs)?
                }
                (Some(width), Some(rest)) => Length::Numbers(width.checked_div(rest)),
                (None, Some(1)) if marked => Length::Numbers(None),
                _ => return None,
            };
        }
        let form = Self { lengths, column: None };
        let fits = form == *self || form.width() == self.width();
        let fits = fits && inputs(&form.lengths) <= inputs(&self.lengths);
        (fits && self.is_in_order() && form.is_in_order()).then_some(form)
    }

    /// Dimensions of length 1 put in.
    pub(super) fn unsqueezed(mut self, axes: &[i64]) -> Option<Self> {
        let rank = (self.rank() + axes.len()) as i64;
        let place = |&axis: &i64| usize::try_from(if axis < 0 { axis + rank } else { axis }).ok();
        let mut places = axes.iter().map(place).collect::<Option<Vec<usize>>>()?;
        places.sort_unstable();
        for place in places {
            (place <= self.rank()).then(|| self.lengths.insert(place, ONE))?;
        }
        Some(self)
    }

    /// Dimensions of length 1 taken out: these, or all.
    pub(super) fn squeezed(mut self, axes: Option<&[i64]>) -> Option<Self> {
        let places: Vec<usize> = match axes {
            Some(axes) => axes.iter().map(|&axis| self.axis(axis).ok()).collect::<Option<_>>()?,
            None => (0..self.rank()).filter(|&i| self.lengths[i] == ONE).collect(),
        };
        let mut i = 0;
        let all_ones = places.iter().all(|&place| self.lengths[place] == ONE);
        self.lengths.retain(|_| {
            i += 1;
            !places.contains(&(i - 1))
        });
        all_ones.then_some(self)
    }

    /// Its dimensions in another order, turned around if none is given; the numbers of an input keep theirs.
    pub(super) fn transposed(self, order: Option<&[i64]>) -> Option<Self> {
        let form = self.into_column();
        let rank = form.rank();
        let order: Vec<usize> = match order {
            None => (0..rank).rev().collect(),
            Some(order) => order.iter().map(|&i| usize::try_from(i).ok()).collect::<Option<_>>()?,
        };
        let mut sorted = order.clone();
        sorted.sort_unstable();
        let of_numbers = |i: &usize| !matches!(form.lengths[*i], ONE | Length::Inputs);
        let is_order = sorted.iter().copied().eq(0..rank);
        (is_order && order.iter().copied().filter(of_numbers).is_sorted()).then(|| Self {
            lengths: order.iter().map(|&i| form.lengths[i]).collect(),
            column: None,
        })
    }

    /// Whether the numbers of an input lie next to each other.
    pub(super) fn is_in_order(&self) -> bool {
        let inputs = self.lengths.iter().position(|length| *length == Length::Inputs);
        self.lengths[..inputs.unwrap_or(0)].iter().all(|length| *length == ONE)
    }
}

impl std::fmt::Display for Form {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let word = |length: &Length| match length {
            Length::Inputs => "inputs".to_owned(),
            Length::Numbers(Some(length)) => length.to_string(),
            Length::Numbers(None) => "?".to_owned(),
        };
        let words: Vec<String> = self.lengths.iter().map(word).collect();
        write!(f, "[{}]", words.join(", "))
    }
}
