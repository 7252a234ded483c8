//! Networks that rollouts run themselves, in workgroup memory: which are, and what they take.

use super::attempt::MAX_TRIPS;
use super::compose::Fused;
use super::listing::{Adapter, AdapterKind};
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Widest network that rollouts run themselves: beyond, its activations leave no room for a second
/// workgroup, and its parameters do not stay in the caches.
const FUSED_WIDTH: usize = 128;

/// How rollouts run the network that drives them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NetworkKernels {
    /// Fused where that should be faster: networks of at most 128 neurons per layer, on hardware
    /// whose workgroups have the memory. Nothing of a trajectory then leaves its workgroup before
    /// the last step, and there is one dispatch instead of one per layer and step. A software
    /// adapter gets layers: workgroup memory is ordinary memory there, and the larger number of
    /// barriers costs.
    #[default]
    Chosen,
    /// A dispatch per layer and step, activations in storage.
    Layered,
    /// The rollout kernel runs all layers of all steps, activations in workgroup memory.
    Fused,
}

/// The layers of `network` if rollouts on `adapter` run them themselves.
///
/// # Errors
/// [`Error::Device`] if that is asked for and not possible.
pub(super) fn fused(
    adapter: &Adapter,
    network: Option<&Mlp>,
    wanted: NetworkKernels,
) -> Result<Option<Fused>> {
    let Some(mlp) = network.filter(|_| wanted != NetworkKernels::Layered) else {
        return Ok(None);
    };
    let fused = Fused::new(mlp);
    let widest = mlp.widths().into_iter().max().unwrap_or(0);
    let fits = widest <= FUSED_WIDTH
        && fused.workgroup_bytes() <= u64::from(adapter.max_workgroup_bytes)
        && fused.lanes() <= adapter.max_workgroup_threads
        && step_trips(&fused, 2) <= MAX_TRIPS;
    match wanted {
        NetworkKernels::Fused if !fits => Err(Error::Device(format!(
            "a network of {widest} neurons per layer does not fuse: at most {FUSED_WIDTH}, and \
             {} bytes of workgroup memory, of which {} has {}; run it in layers",
            fused.workgroup_bytes(),
            adapter.name,
            adapter.max_workgroup_bytes
        ))),
        NetworkKernels::Chosen if adapter.kind == AdapterKind::Software => Ok(None),
        _ => Ok(fits.then_some(fused)),
    }
}

/// Loop iterations of a thread for one step of `sides` trajectories that runs the network itself.
pub(super) fn step_trips(fused: &Fused, sides: u32) -> u64 {
    1 + u64::from(sides) * fused.trips()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::policy::{Activation, Layer, OutputActivation};

    /// A network of these widths, all of it 0.
    pub(in crate::backend::gpu) fn network(widths: &[usize]) -> Mlp {
        let layer = |pair: &[usize]| Layer {
            weight: vec![0.0; pair[0] * pair[1]],
            bias: vec![0.0; pair[1]],
            inputs: pair[0],
            outputs: pair[1],
        };
        let layers = widths.windows(2).map(layer).collect();
        Mlp::new(layers, Activation::Relu, OutputActivation::Tanh).expect("a whole network")
    }

    /// Whether a network of these widths is fused on hardware with `bytes` of workgroup memory.
    fn fuses(widths: &[usize], bytes: u32, kind: AdapterKind, wanted: NetworkKernels) -> bool {
        let adapter = Adapter { kind, max_workgroup_bytes: bytes, ..Adapter::made_up(1 << 27) };
        let fused = fused(&adapter, Some(&network(widths)), wanted);
        fused.is_ok_and(|fused| fused.is_some())
    }

    #[test]
    fn networks_fuse_where_they_fit() {
        use AdapterKind::{Discrete, Software};
        use NetworkKernels::{Chosen, Layered};
        let (least, usual) = (16 << 10, 32 << 10);
        assert!(fuses(&[12, 64, 64, 64, 3], least, Discrete, Chosen));
        assert!(!fuses(&[12, 128, 128, 3], least, Discrete, Chosen), "16 KiB hold 64 neurons");
        assert!(fuses(&[12, 128, 128, 3], usual, Discrete, Chosen));
        assert!(!fuses(&[12, 129, 3], 1 << 20, Discrete, Chosen), "too wide");
        assert!(!fuses(&[12, 129, 3], 1 << 20, Discrete, NetworkKernels::Fused), "too wide");
        assert!(!fuses(&[12, 64, 3], usual, Software, Chosen));
        assert!(fuses(&[12, 64, 3], usual, Software, NetworkKernels::Fused));
        assert!(!fuses(&[12, 64, 3], usual, Discrete, Layered));
    }
}
