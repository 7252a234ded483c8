//! Where training draws its starts from: a mixture of boxes, each start a function of its index.

use crate::rollout::{Purpose, Region, Starts, Stream};

/// Boxes with the share of the starts that each gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture<const NX: usize> {
    /// Shares above 0, and boxes.
    pub parts: Vec<(f64, Region)>,
}

impl<const NX: usize> Mixture<NX> {
    /// Batch number `batch` of `count` starts for `purpose`, part by part.
    pub fn draw(&self, seed: u64, purpose: Purpose, batch: u64, count: usize) -> Vec<[f32; NX]> {
        let total: f64 = self.parts.iter().map(|(share, _)| share).sum();
        let mut starts = Vec::with_capacity(count);
        let mut filled = 0.0;
        for (number, (share, region)) in self.parts.iter().enumerate() {
            filled += share / total;
            let end = (filled * count as f64).round() as usize;
            let stream = Stream::new(seed, purpose, number as u32);
            let drawn = Starts::Drawn { region: region.clone(), stream };
            // Each batch has `count` indices of each part's stream to itself.
            let first = batch * count as u64;
            let more =
                (starts.len()..end.min(count)).map(|place| drawn.start_array(first + place as u64));
            starts.extend(more.collect::<Vec<_>>());
        }
        starts
    }
}
