//! Networks that formulas call like functions: kept whole, evaluated once for all their outputs.

use std::sync::Arc;

use crate::policy::Mlp;
use crate::real::{Lanes, Real};

/// The call of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The network.
    pub network: Arc<Mlp>,
    /// The nodes that are its inputs, in their order.
    pub arguments: Vec<u32>,
}

impl Call {
    /// Whether it is the call of `network` at `arguments`.
    pub(super) fn is(&self, network: &Arc<Mlp>, arguments: &[u32]) -> bool {
        let same = || Arc::ptr_eq(&self.network, network) || self.network == *network;
        self.arguments == arguments && same()
    }

    /// The same where each argument is at another place.
    pub(super) fn renumbered(&self, place: &[u32]) -> Self {
        let arguments = self.arguments.iter().map(|at| place[*at as usize]).collect();
        Self { network: Arc::clone(&self.network), arguments }
    }

    /// Number of outputs of the network.
    pub(super) fn outputs(&self) -> usize {
        self.network.widths().last().copied().unwrap_or(0)
    }
}

/// A number that formulas as text are evaluated over: one that networks can be called with.
pub trait Scalar: Real {
    /// The outputs of `network` at `inputs`, as many as it takes: one neuron after the other, unless the
    /// network is recorded as a whole.
    fn call(network: &Arc<Mlp>, inputs: &[Self]) -> Vec<Self> {
        network.forward(inputs)
    }
}

impl Scalar for f32 {}
impl Scalar for f64 {}
impl<const N: usize> Scalar for Lanes<N> {}
