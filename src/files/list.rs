//! States one after the other, `[count, size]`: borrowed, or a list of one's own.

use crate::error::{Error, Result};

/// States one after the other: `[count, size]`, borrowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct States<'a> {
    size: usize,
    numbers: &'a [f32],
}

impl<'a> States<'a> {
    /// States of `size` numbers each.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the numbers are no whole number of states.
    pub fn new(numbers: &'a [f32], size: usize) -> Result<Self> {
        if numbers.len().is_multiple_of(size) {
            return Ok(Self { size, numbers });
        }
        let problem = format!("{} numbers are no whole number of states of {size}", numbers.len());
        Err(Error::invalid("states", problem))
    }

    /// The same of numbers that are known to be whole states.
    pub(crate) fn of(numbers: &'a [f32], size: usize) -> Self {
        debug_assert!(numbers.len().is_multiple_of(size), "states of {size} numbers");
        Self { size, numbers }
    }

    /// A single state.
    pub fn one(state: &'a [f32]) -> Self {
        Self { size: state.len(), numbers: state }
    }

    /// How many there are; none where a state has no number.
    pub fn len(&self) -> usize {
        self.numbers.len().checked_div(self.size).unwrap_or(0)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// Numbers of a state.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The state number `index`.
    pub fn row(&self, index: usize) -> &'a [f32] {
        &self.numbers[index * self.size..][..self.size]
    }

    /// All their numbers, one state after the other.
    pub fn numbers(&self) -> &'a [f32] {
        self.numbers
    }

    /// One after the other.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &'a [f32]> + use<'a> {
        self.numbers.chunks_exact(self.size.max(1))
    }
}

impl<'a, const NX: usize> From<&'a [[f32; NX]]> for States<'a> {
    fn from(list: &'a [[f32; NX]]) -> Self {
        Self { size: NX, numbers: list.as_flattened() }
    }
}

impl<'a, const NX: usize> From<&'a Vec<[f32; NX]>> for States<'a> {
    fn from(list: &'a Vec<[f32; NX]>) -> Self {
        list.as_slice().into()
    }
}

impl<'a, const NX: usize, const COUNT: usize> From<&'a [[f32; NX]; COUNT]> for States<'a> {
    fn from(list: &'a [[f32; NX]; COUNT]) -> Self {
        list.as_slice().into()
    }
}

/// A list of states of the same size, `[count, size]`.
#[derive(Clone, Debug, PartialEq)]
pub struct StateList {
    size: usize,
    numbers: Vec<f32>,
}

impl StateList {
    /// No state yet, of `size` numbers each.
    pub fn new(size: usize) -> Self {
        Self { size, numbers: Vec::new() }
    }

    /// Adds a state.
    ///
    /// # Panics
    /// If it has another size.
    pub fn push(&mut self, state: &[f32]) {
        assert_eq!(state.len(), self.size, "numbers of a state");
        self.numbers.extend_from_slice(state);
    }

    /// Puts `state` in the place of number `index`.
    ///
    /// # Panics
    /// If it has another size, or there is no such place.
    pub fn set(&mut self, index: usize, state: &[f32]) {
        self.numbers[index * self.size..][..self.size].copy_from_slice(state);
    }

    /// The list with `more` states behind.
    #[must_use]
    pub fn with<S: AsRef<[f32]>>(mut self, more: impl IntoIterator<Item = S>) -> Self {
        more.into_iter().for_each(|state| self.push(state.as_ref()));
        self
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.view().len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// The state number `index`.
    pub fn row(&self, index: usize) -> &[f32] {
        self.view().row(index)
    }

    /// One after the other.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.view().iter()
    }

    /// All of them as arrays of `NX` numbers.
    ///
    /// # Panics
    /// If a state has fewer.
    pub fn arrays<const NX: usize>(&self) -> Vec<[f32; NX]> {
        self.iter().map(|state| std::array::from_fn(|i| state[i])).collect()
    }

    /// All of them.
    pub fn view(&self) -> States<'_> {
        States::of(&self.numbers, self.size)
    }
}

impl<'a> From<&'a StateList> for States<'a> {
    fn from(list: &'a StateList) -> Self {
        list.view()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_whole_states() {
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let states = States::new(&numbers, 3).expect("two states");
        assert_eq!((states.len(), states.row(1)), (2, &numbers[3..]));
        for size in [0, 4] {
            let refused = States::new(&numbers, size).expect_err("no whole number").to_string();
            assert!(
                refused.contains(&format!("6 numbers are no whole number of states of {size}"))
            );
        }
        // What has no numbers is no state.
        let nothing = [States::one(&[]), States::new(&[], 0).expect("none"), (&[[]; 3]).into()];
        assert!(nothing.iter().all(|none| none.is_empty() && none.iter().len() == 0));
        assert_eq!(StateList::new(0).with([[]; 2]).len(), 0);
    }
}
