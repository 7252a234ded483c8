//! Networks packed once: a controller asks for the same few at every step.

use std::sync::{Arc, Mutex, PoisonError};

use super::mlp::Packed;
use crate::policy::Mlp;

/// Most networks that are kept: policy, value, disturbance, and as many of a second plant.
const MOST: usize = 6;

/// The networks that were packed last, the latest first.
#[derive(Debug, Default)]
pub(super) struct Packs(Mutex<Vec<(Mlp, Arc<Packed>)>>);

impl Packs {
    /// `network` in panels of `rows` neurons, packed now unless it is still at hand.
    pub(super) fn of(&self, network: &Mlp, rows: usize) -> Arc<Packed> {
        let mut recent = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = recent.iter().position(|(known, _)| known.is_same(network));
        let pack = || (network.clone(), Arc::new(Packed::new(network, rows)));
        let entry = found.map_or_else(pack, |at| recent.remove(at));
        let packed = Arc::clone(&entry.1);
        recent.insert(0, entry);
        recent.truncate(MOST);
        packed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Activation, Layer};

    fn network(bias: f32) -> Mlp {
        let layer = Layer::dense(vec![1.0, 2.0], vec![bias]);
        Mlp::new(vec![layer], Activation::Relu, Activation::Tanh).expect("a network")
    }

    #[test]
    fn a_network_is_packed_once_and_told_from_others() {
        let (packs, one) = (Packs::default(), network(0.0));
        let first = packs.of(&one, 8);
        assert!(Arc::ptr_eq(&first, &packs.of(&one.clone(), 8)));
        // Equal numbers in another place are packed again: only the place is compared.
        let others: Vec<Mlp> = (0..MOST).map(|i| network(i as f32)).collect();
        let packed: Vec<_> = others.iter().map(|other| packs.of(other, 8)).collect();
        assert!(packed.iter().all(|other| !Arc::ptr_eq(other, &first)));
        assert!(Arc::ptr_eq(&packed[0], &packs.of(&others[0], 8)), "the oldest of those kept");
        assert!(!Arc::ptr_eq(&first, &packs.of(&one, 8)), "too many came in between");
    }
}
