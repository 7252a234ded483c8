//! Policies: a formula over `Real`, or a trained network.

mod activation;
mod core;
#[cfg(feature = "import")]
mod export;
mod file;
#[cfg(feature = "import")]
pub mod import;
pub mod inspect;
mod layer;
mod mlp;
#[cfg(feature = "import")]
mod onnx;
mod repeated;
mod spectral;

pub use activation::Activation;
pub(crate) use core::Parts;
#[cfg(feature = "import")]
pub use export::onnx_bytes;
pub use layer::{Layer, Norm, Rescale};
pub(crate) use layer::{normaliser, normaliser_range};
pub use mlp::Mlp;

use crate::real::Real;

/// A deterministic policy `u = pi(x)`.
///
/// A formula implements [`Policy::control`] alone: it is vectorised and printed as WGSL like the
/// physics. A policy that returns a [`Policy::network`] is evaluated layer by layer by the
/// backends, and its `control` is the reference for that.
pub trait Policy<const NX: usize, const NU: usize>: Sync {
    /// Short name for reports.
    fn name(&self) -> String;

    /// The network, where the policy is one.
    fn network(&self) -> Option<&Mlp> {
        None
    }

    /// The control at `x`.
    fn control<R: Real>(&self, x: [R; NX]) -> [R; NU];
}

impl<P: Policy<NX, NU>, const NX: usize, const NU: usize> Policy<NX, NU> for &P {
    fn name(&self) -> String {
        (**self).name()
    }
    fn network(&self) -> Option<&Mlp> {
        (**self).network()
    }
    #[inline(always)]
    fn control<R: Real>(&self, x: [R; NX]) -> [R; NU] {
        (**self).control(x)
    }
}

impl<const NX: usize, const NU: usize> Policy<NX, NU> for Mlp {
    fn name(&self) -> String {
        self.in_words()
    }

    fn network(&self) -> Option<&Mlp> {
        Some(self)
    }

    fn control<R: Real>(&self, x: [R; NX]) -> [R; NU] {
        let output = self.forward(&x);
        std::array::from_fn(|i| output[i])
    }
}
