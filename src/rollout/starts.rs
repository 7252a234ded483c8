//! Where the starts and pairs of a batch come from: drawn by their index, or listed.

use super::region::{Region, sample_ball};
use super::sample::Stream;
use crate::files::States;
use crate::real::{Lanes, Real};

/// Where the starts of a batch come from.
#[derive(Clone, Debug)]
pub enum Starts<'a> {
    /// Drawn uniformly from a region.
    Drawn {
        /// The region.
        region: Region,
        /// The stream.
        stream: Stream,
    },
    /// Given one by one.
    Listed(States<'a>),
}

impl<'a> Starts<'a> {
    /// The starts of a list.
    pub fn listed(list: impl Into<States<'a>>) -> Self {
        Self::Listed(list.into())
    }

    /// Numbers of a start.
    pub fn size(&self) -> usize {
        match self {
            Self::Drawn { region, .. } => region.size(),
            Self::Listed(list) => list.size(),
        }
    }

    /// The starts `first..first + N`, one per lane, past the end of a list its last one; `x` has a
    /// row for each coordinate.
    #[inline(always)]
    pub fn load<const N: usize>(&self, first: u64, x: &mut [Lanes<N>]) {
        match self {
            Self::Drawn { region, stream } => region.sample(*stream, first, x),
            Self::Listed(list) => {
                for i in 0..N {
                    let row = list.row((first as usize + i).min(list.len() - 1));
                    for (x, value) in x.iter_mut().zip(row) {
                        x.0[i] = *value;
                    }
                }
            }
        }
    }

    /// The start number `index`.
    pub fn start(&self, index: u64) -> Vec<f32> {
        let mut x = vec![Lanes([0.0]); self.size()];
        self.load::<1>(index, &mut x);
        x.into_iter().map(|lane| lane.0[0]).collect()
    }

    /// The start number `index`, of `NX` numbers.
    ///
    /// # Panics
    /// If a start has fewer.
    pub fn start_array<const NX: usize>(&self, index: u64) -> [f32; NX] {
        let start = self.start(index);
        std::array::from_fn(|i| start[i])
    }
}

/// Pairs of a nominal and a perturbed start, `docs/method.md` section 3.
#[derive(Clone, Debug)]
pub struct Pairs<'a> {
    /// Nominal starts.
    pub nominal: Starts<'a>,
    /// Radius of the ball around each nominal start.
    pub radius: f32,
    /// Stream of the perturbations.
    pub stream: Stream,
}

impl Pairs<'_> {
    /// The pairs `first..first + N`: rows of the nominal starts, then of the perturbed ones.
    #[inline(always)]
    pub fn load<const N: usize>(
        &self,
        first: u64,
        nominal: &mut [Lanes<N>],
        perturbed: &mut [Lanes<N>],
    ) {
        self.nominal.load(first, nominal);
        sample_ball(self.stream, first, |_| true, perturbed);
        for (x, nominal) in perturbed.iter_mut().zip(nominal) {
            *x = *nominal + Lanes::lit(self.radius) * *x;
        }
    }

    /// The pair number `index`: nominal, then perturbed.
    pub fn pair(&self, index: u64) -> [Vec<f32>; 2] {
        let mut rows = [(); 2].map(|()| vec![Lanes([0.0]); self.nominal.size()]);
        let [nominal, perturbed] = &mut rows;
        self.load::<1>(index, nominal, perturbed);
        rows.map(|rows| rows.into_iter().map(|lane| lane.0[0]).collect())
    }
}
