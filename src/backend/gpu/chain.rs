//! Formulas that call networks on the device: the parts between networks, and the networks' layers.

use super::batch::Batch;
use super::buffer::{Buffer, Pool, Use};
use super::chain_load::ChainLoad;
use super::compiled::Compiled;
use super::compose::{
    AskShape, ChainText, Kernel, LayerShape, Slot, input_quads, layer_kernel, output_quads,
};
use super::device::Device;
use super::flight::Flight;
use super::inputs::Inputs;
use super::kernel::Bound;
use super::network::push_layers;
use super::params::Params;
use crate::error::Result;
use crate::policy::Mlp;

/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: u64 = 16;

/// The buffers of a chain.
pub(super) struct ChainBuffers {
    kept: Buffer,
    asked: Buffer,
    said: Buffer,
    activations: [Buffer; 2],
    /// Trajectories in each row.
    row: u64,
}

impl ChainBuffers {
    /// For `row` trajectories.
    pub(super) fn new(device: &Device, pool: &Pool, chain: &ChainText, row: u32) -> Self {
        let row = u64::from(row);
        let [kept, asked, said, first, second] =
            ChainLoad::new(chain).bytes.map(|bytes| pool.take(device, Use::Storage, bytes * row));
        Self { kept, asked, said, activations: [first, second], row }
    }

    /// Bytes of them.
    pub(super) fn size(&self) -> u64 {
        let Self { kept, asked, said, activations: [first, second], .. } = self;
        [kept, asked, said, first, second].into_iter().map(Buffer::size).sum()
    }

    /// What rollouts read of it.
    pub(super) fn kept(&self) -> &Buffer {
        &self.kept
    }

    /// `numbers` of `buffer`, which begin at a whole vector, as layers see them; `quads` vectors.
    fn part<'a>(&self, buffer: &'a Buffer, start: usize, quads: usize) -> wgpu::BufferBinding<'a> {
        let vector = VECTOR_BYTES * self.row;
        buffer.part(start as u64 / 4 * vector, quads as u64 * vector)
    }
}

/// A chain bound to one set of columns.
pub(super) struct BoundChain {
    links: Vec<BoundLink>,
    /// How many of them come before the controls are known.
    deciding: usize,
}

/// A link, and the networks behind it.
struct BoundLink {
    link: Bound,
    asks: Vec<BoundAsk>,
}

/// The layers of a network.
struct BoundAsk {
    layers: Vec<Bound>,
    shapes: Vec<LayerShape>,
}

/// What a chain is bound to.
pub(super) struct ChainBinder<'a> {
    pub(super) flight: &'a Flight<'a>,
    pub(super) compiled: &'a Compiled,
    pub(super) inputs: &'a Inputs,
    pub(super) buffers: &'a ChainBuffers,
    /// The states that it starts from.
    pub(super) state: &'a Buffer,
}

impl ChainBinder<'_> {
    /// All links of `chain` with their networks.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn bind(&self, chain: &ChainText) -> Result<BoundChain> {
        let link = |number: usize| {
            let asks = chain.asks(number).iter().map(|ask| self.ask(chain, ask));
            Ok(BoundLink { link: self.link(number)?, asks: asks.collect::<Result<_>>()? })
        };
        let links = (0..chain.count()).map(link).collect::<Result<_>>()?;
        Ok(BoundChain { links, deciding: chain.deciding() })
    }

    fn link(&self, number: usize) -> Result<Bound> {
        let device = &self.flight.device;
        let pipeline = self.compiled.pipeline(device, Kernel::Link(number as u32), 0)?;
        let ChainBuffers { kept, asked, said, .. } = self.buffers;
        let buffer = |slot| match slot {
            Slot::Kept => kept,
            Slot::Asked => asked,
            Slot::Said => said,
            _ => self.state,
        };
        let part = |slot| self.inputs.binding(slot).unwrap_or_else(|| buffer(slot).binding());
        Ok(pipeline.bind(device, part))
    }

    /// The layers of a network: from what it is asked to what it says.
    fn ask(&self, chain: &ChainText, ask: &AskShape) -> Result<BoundAsk> {
        let mlp = &chain.networks()[ask.network];
        let shapes = LayerShape::of(mlp);
        let layer = |(i, kernel): (usize, Kernel)| {
            let pipeline = self.compiled.given(
                &self.flight.device,
                kernel,
                kernel.bindings(false),
                layer_kernel(mlp, kernel),
            )?;
            Ok(pipeline.bind(&self.flight.device, |slot| {
                let part = self.inputs.binding(slot);
                part.unwrap_or_else(|| self.end(slot, mlp, ask, i))
            }))
        };
        let kernels = shapes.iter().enumerate();
        let kernels =
            kernels.flat_map(|(i, shape)| shape.kernels().into_iter().map(move |one| (i, one)));
        let layers = kernels.map(layer).collect::<Result<_>>()?;
        Ok(BoundAsk { layers, shapes })
    }

    /// What layer `i` of a network binds in `slot`.
    fn end(&self, slot: Slot, mlp: &Mlp, ask: &AskShape, i: usize) -> wgpu::BufferBinding<'_> {
        let ChainBuffers { asked, said, activations, .. } = self.buffers;
        let layer = &mlp.layers()[i];
        match slot {
            Slot::Weights => self.compiled.called(ask.network).binding(),
            Slot::Source if i == 0 => {
                self.buffers.part(asked, ask.asked.start, input_quads(layer.inputs))
            }
            Slot::Source => activations[(i + 1) % 2].binding(),
            _ if i + 1 == mlp.layers().len() => {
                self.buffers.part(said, ask.said.start, output_quads(layer.outputs))
            }
            _ => activations[i % 2].binding(),
        }
    }
}

/// A step of a chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainStep {
    /// Its number.
    pub(super) step: u32,
    /// The last one, at which nothing moves any more.
    pub(super) horizon: u32,
    /// Trajectories that take part, the first ones of a row.
    pub(super) columns: u32,
    /// Trajectories in each row.
    pub(super) row: u32,
    /// Trajectories that act by themselves: the others act as the one so many columns before does.
    pub(super) acting: u32,
}

impl BoundChain {
    /// Adds the dispatches of a step: margins and controls, and before the last step the next state.
    pub(super) fn push<'a>(&'a self, batch: &mut Batch<'a>, at: ChainStep) {
        let ChainStep { step, horizon, columns, row, acting } = at;
        let count = if step < horizon { self.links.len() } else { self.deciding };
        let params = Params { columns, stride: row, width: acting, step, ..Params::default() };
        for BoundLink { link, asks } in &self.links[..count] {
            batch.push_columns(link, &params);
            for BoundAsk { layers, shapes } in asks {
                push_layers(batch, layers, shapes, columns, row);
            }
        }
    }
}
