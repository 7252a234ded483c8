//! A network with the moments of its optimiser and a copy that follows it slowly.

use super::adam::{Adam, Optimiser};
use super::network::Network;

/// A network that learns, and its slow copy.
#[derive(Clone, Debug)]
pub struct Agent {
    /// The network.
    pub network: Network,
    /// Its average over the past: what the targets of others are computed with.
    pub slow: Network,
    adam: Adam,
}

impl Agent {
    /// `network` before its first update.
    pub fn new(network: Network) -> Self {
        let adam = Adam::new(network.parameters.len());
        Self { slow: network.clone(), network, adam }
    }

    /// Moves the network against `gradient`, and the copy by the share `polyak` toward it.
    pub fn follow(
        &mut self,
        gradient: &[f32],
        optimiser: &Optimiser,
        progress: [u64; 2],
        polyak: f64,
    ) {
        self.adam.update(&mut self.network.parameters, gradient, optimiser, progress);
        for (slow, fast) in self.slow.parameters.iter_mut().zip(&self.network.parameters) {
            *slow += polyak as f32 * (fast - *slow);
        }
    }

    /// What later updates depend on: network, copy and both moments, under these names.
    pub fn arrays(
        &mut self,
        names: [&'static str; 4],
    ) -> impl Iterator<Item = (&'static str, &mut Vec<f32>)> {
        let Self { network, slow, adam } = self;
        let arrays =
            [&mut network.parameters, &mut slow.parameters, &mut adam.first, &mut adam.second];
        names.into_iter().zip(arrays)
    }
}
