//! Where training draws its starts from: a mixture of boxes, each start a function of its index.

use crate::rollout::{Purpose, Region, Starts, StateList, Stream};

/// Boxes with the share of the starts that each gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    /// Shares above 0, and boxes; at least one, all of the same size.
    pub parts: Vec<(f64, Region)>,
}

impl Mixture {
    /// Batch number `batch` of `count` starts for `purpose`, part by part.
    ///
    /// # Panics
    /// If the mixture has no part.
    pub fn draw(&self, seed: u64, purpose: Purpose, batch: u64, count: usize) -> StateList {
        let total: f64 = self.parts.iter().map(|(share, _)| share).sum();
        let mut starts = StateList::new(self.parts[0].1.size());
        let mut filled = 0.0;
        for (number, (share, region)) in self.parts.iter().enumerate() {
            filled += share / total;
            let end = (filled * count as f64).round() as usize;
            let stream = Stream::new(seed, purpose, number as u32);
            let drawn = Starts::Drawn { region: region.clone(), stream };
            // Each batch has `count` indices of each part's stream to itself.
            let first = batch * count as u64;
            for place in starts.len()..end.min(count) {
                starts.push(&drawn.start(first + place as u64));
            }
        }
        starts
    }
}
