//! A network that takes part in MPPI: its parameters and its layers on the device.

use super::batch::Batch;
use super::buffer::Buffer;
use super::call::Call;
use super::compose::{Slot, layer_kernel};
use super::kernel::Bound;
use super::network::{Layers, upload};
use crate::error::Result;
use crate::policy::Mlp;

/// A network on the device, a dispatch per layer.
pub(super) struct Network<'a> {
    mlp: &'a Mlp,
    weights: Buffer,
    layers: Layers,
}

impl<'a> Network<'a> {
    /// Uploads `mlp`; its activations have `row` columns.
    pub(super) fn new(call: &Call<'_>, mlp: &'a Mlp, row: u32) -> Self {
        let (device, pool) = (call.device(), call.pool());
        let (weights, layers) = (upload(device, pool, mlp), Layers::new(device, pool, mlp, row));
        Self { mlp, weights, layers }
    }

    /// Where the last layer leaves its outputs.
    pub(super) fn output(&self) -> &Buffer {
        self.layers.output()
    }

    /// The layers bound to `state` as their input.
    pub(super) fn bind(&self, call: &Call<'_>, state: &Buffer) -> Result<Vec<Bound>> {
        self.layers.bind(state, |kernel, [source, sink]| {
            let text = layer_kernel(self.mlp, kernel);
            call.bind(kernel, kernel.bindings(false), text, |slot| match slot {
                Slot::Weights => &self.weights,
                Slot::Source => source,
                _ => sink,
            })
        })
    }

    /// Adds the dispatches of all layers over the first `columns` columns, in rows of `row`.
    pub(super) fn forward<'b>(
        &self,
        batch: &mut Batch<'b>,
        bound: &'b [Bound],
        (columns, row): (u32, u32),
    ) {
        self.layers.forward(batch, bound, (columns, row));
    }
}
