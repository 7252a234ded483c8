//! What off-policy learning remembers: the latest rows of numbers, in a ring.

use crate::rollout::Stream;

/// A ring of rows. Where the next one goes follows from how many there have been.
#[derive(Clone, Debug)]
pub struct Replay {
    columns: usize,
    /// The rows, one after the other; those not written yet hold zeros.
    pub rows: Vec<f32>,
}

impl Replay {
    /// Room for `capacity` rows of `columns` numbers.
    pub fn new(capacity: usize, columns: usize) -> Self {
        Self { columns, rows: vec![0.0; capacity * columns] }
    }

    /// Number of rows that there is room for.
    fn capacity(&self) -> usize {
        self.rows.len() / self.columns
    }

    /// Writes `row` as the one number `number` of all so far, counted from 0.
    ///
    /// # Panics
    /// If it has not the ring's columns.
    pub fn write(&mut self, number: u64, row: &[f32]) {
        let place = (number % self.capacity() as u64) as usize * self.columns;
        self.rows[place..place + self.columns].copy_from_slice(row);
    }

    /// `count` rows after `written` were written, drawn with replacement as the samples from number
    /// `first` of `stream` on.
    pub fn draw(
        &self,
        written: u64,
        stream: Stream,
        first: u64,
        count: usize,
    ) -> impl Iterator<Item = &[f32]> {
        let filled = written.min(self.capacity() as u64);
        (first..first + count as u64).map(move |index| {
            let [[word], ..] = stream.words::<1>(index, 0);
            let place = (u64::from(word) % filled) as usize * self.columns;
            &self.rows[place..place + self.columns]
        })
    }
}
