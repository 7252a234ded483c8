//! States one after the other, `[count, size]`: borrowed, or a list of one's own.

/// States one after the other: `[count, size]`, borrowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct States<'a> {
    size: usize,
    numbers: &'a [f32],
}

impl<'a> States<'a> {
    /// States of `size` numbers each.
    ///
    /// # Panics
    /// If `size` is 0, or the numbers are no whole number of states.
    pub fn new(numbers: &'a [f32], size: usize) -> Self {
        assert!(size > 0 && numbers.len().is_multiple_of(size), "states of {size} numbers");
        Self { size, numbers }
    }

    /// A single state.
    ///
    /// # Panics
    /// If it has no number.
    pub fn one(state: &'a [f32]) -> Self {
        Self::new(state, state.len())
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.numbers.len() / self.size
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
        self.numbers.chunks_exact(self.size)
    }
}

impl<'a, const NX: usize> From<&'a [[f32; NX]]> for States<'a> {
    fn from(list: &'a [[f32; NX]]) -> Self {
        Self::new(list.as_flattened(), NX)
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
    ///
    /// # Panics
    /// If `size` is 0.
    pub fn new(size: usize) -> Self {
        assert!(size > 0, "a state has at least one number");
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
        States::new(&self.numbers, self.size)
    }
}

impl<'a> From<&'a StateList> for States<'a> {
    fn from(list: &'a StateList) -> Self {
        list.view()
    }
}
