//! The buffers of calls of one shape, and the kernels bound to them.

use super::batch::Batch;
use super::buffer::{Buffer, Use};
use super::chain::{BoundChain, ChainBinder, ChainBuffers, ChainStep};
use super::chain_load::ChainLoad;
use super::chunking::{Chunking, Work};
use super::compiled::Compiled;
use super::compose::{Kernel, Slot};
use super::flight::Flight;
use super::inputs::{InputSizes, Inputs};
use super::kernel::Bound;
use super::network::Layers;
use super::params::Params;
use super::readback::Readback;
use crate::error::Result;
use crate::policy::Mlp;

/// What decides the sizes of all buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// What is asked of the rollouts.
    pub(super) work: Work,
    /// Whether the host lists the starts.
    pub(super) listed: bool,
    /// Steps.
    pub(super) horizon: u32,
    /// How the batch is cut up.
    pub(super) chunking: Chunking,
}

/// Offset of the measures in what is read back, bytes.
pub(super) const MEASURES_AT: u64 = 8;

/// Buffers and kernels for one call at a time.
pub(super) struct Workspace {
    pub(super) shape: Shape,
    pub(super) inputs: Inputs,
    pub(super) readback: Readback,
    pub(super) buffers: Buffers,
    /// Bound to the first set of columns; for signs also to the second one.
    pub(super) kernels: Vec<Kernels>,
}

impl Workspace {
    /// Buffers for `shape`, and the kernels of `compiled` bound to them.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn new(
        flight: &Flight<'_>,
        compiled: &Compiled,
        network: Option<&Mlp>,
        shape: Shape,
    ) -> Result<Self> {
        let (device, pool) = (&flight.device, flight.pool);
        let (quads, chunking) = (compiled.text.states().div_ceil(4), shape.chunking);
        let layers = network.map_or(0, |mlp| mlp.layers().len());
        let chain = compiled.text.chain().map(ChainLoad::new);
        let chained = chain.map_or(0, |load| load.dispatches);
        let sizes = InputSizes {
            values: compiled.text.parameters().div_ceil(4),
            steps: shape.horizon as usize + 1,
            region: if shape.listed { quads * chunking.stride as usize } else { 4 * quads },
            // The draw, compaction or reduction, and each step with what its networks need.
            dispatches: 2 + chunking.segment as usize * (layers + chained + 2),
        };
        let inputs = Inputs::new(device, pool, sizes);
        let buffers = Buffers::new(flight, compiled, network, shape);
        let sets = if shape.work == Work::Sign { 2 } else { 1 };
        let columns = chunking.stride;
        let binder = Binder { flight, compiled, inputs: &inputs, buffers: &buffers, columns };
        let kernels =
            (0..sets).map(|set| binder.kernels(shape.work, set)).collect::<Result<_>>()?;
        let results = u64::from(shape.work.sides()) * 4 * u64::from(chunking.stride);
        let farthest = 8 * (u64::from(shape.horizon) + 1);
        let readback = Readback::new(device, pool, MEASURES_AT + results + farthest);
        Ok(Self { shape, inputs, readback, buffers, kernels })
    }

    /// Bytes of its buffers, without those of the results.
    pub(super) fn size(&self) -> u64 {
        self.inputs.size() + self.buffers.bytes
    }
}

/// The buffers that only kernels write to.
pub(super) struct Buffers {
    slots: Vec<(Slot, Buffer)>,
    layers: Option<Layers>,
    /// What the network sees, where that is not the state.
    seen: Option<Buffer>,
    /// What formulas and the networks that they call hand on.
    chain: Option<ChainBuffers>,
    bytes: u64,
}

impl Buffers {
    fn new(flight: &Flight<'_>, compiled: &Compiled, network: Option<&Mlp>, shape: Shape) -> Self {
        let storage = |bytes| flight.pool.take(&flight.device, Use::Storage, bytes);
        let sizes = sizes(shape, compiled.text.states());
        let row = shape.chunking.row;
        let layered = network.filter(|_| compiled.text.fused().is_none());
        let seen = layered.filter(|_| compiled.text.observes()).map(|mlp| mlp.widths()[0]);
        let slots: Vec<_> = sizes.into_iter().map(|(slot, bytes)| (slot, storage(bytes))).collect();
        let layers = layered.map(|mlp| Layers::new(&flight.device, flight.pool, mlp, row));
        let seen = seen.map(|seen| storage(16 * seen.div_ceil(4) as u64 * u64::from(row)));
        let all = slots.iter().map(|(_, buffer)| buffer).chain(&seen);
        let chain = |chain| ChainBuffers::new(&flight.device, flight.pool, chain, row);
        let chain = compiled.text.chain().map(chain);
        let bytes = all.map(Buffer::size).sum::<u64>()
            + layers.as_ref().map_or(0, Layers::size)
            + chain.as_ref().map_or(0, ChainBuffers::size);
        Self { bytes, slots, layers, seen, chain }
    }

    /// The buffer of `slot`.
    pub(super) fn of(&self, slot: Slot) -> &Buffer {
        let found = self.slots.iter().find(|(known, _)| *known == slot);
        // A kernel binds no more than its work has buffers for.
        &found.unwrap_or(&self.slots[0]).1
    }

    /// The buffer of `slot` for the set of columns number `set`: the kernels on the second one
    /// compact into the first.
    fn of_set(&self, slot: Slot, set: usize) -> &Buffer {
        let other = match slot {
            Slot::State => Slot::KeptState,
            Slot::Folds => Slot::KeptFolds,
            Slot::Origin => Slot::KeptOrigin,
            Slot::KeptState => Slot::State,
            Slot::KeptFolds => Slot::Folds,
            Slot::KeptOrigin => Slot::Origin,
            same => same,
        };
        self.of(if set == 0 { slot } else { other })
    }
}

/// Bytes of each buffer.
fn sizes(Shape { work, horizon, chunking, .. }: Shape, states: usize) -> Vec<(Slot, u64)> {
    let (row, stride) = (u64::from(chunking.row), u64::from(chunking.stride));
    let state = 16 * states.div_ceil(4) as u64 * row;
    let measures = 4 * stride * u64::from(work.sides());
    let mut sizes = vec![
        (Slot::State, state),
        (Slot::Folds, 8 * row),
        (Slot::Origin, 4 * stride),
        (Slot::Measures, measures),
    ];
    match work {
        Work::Measure => {}
        Work::Sign => sizes.extend([
            (Slot::KeptState, state),
            (Slot::KeptFolds, 8 * row),
            (Slot::KeptOrigin, 4 * stride),
            (Slot::Survivors, 4),
        ]),
        Work::Pairs => sizes.extend([
            (Slot::Distances, 4 * stride * u64::from(chunking.segment)),
            (Slot::Farthest, 8 * (u64::from(horizon) + 1)),
        ]),
    }
    sizes
}

/// The kernels bound to one set of columns.
pub(super) struct Kernels {
    pub(super) sample: Bound,
    pub(super) rollout: Bound,
    /// Compaction of signs, reduction of pairs, nothing for measures.
    pub(super) after: Option<Bound>,
    observe: Option<Bound>,
    layers: Vec<Bound>,
    chain: Option<BoundChain>,
}

impl Kernels {
    /// Adds the dispatches of a step of formulas that call networks; none where none does.
    pub(super) fn chain<'a>(&'a self, batch: &mut Batch<'a>, at: ChainStep) {
        if let Some(chain) = &self.chain {
            chain.push(batch, at);
        }
    }

    /// Adds the dispatches by which a network drives step `step` of the first `columns` columns, in
    /// rows of `row`; none where the rollout kernel drives itself.
    pub(super) fn drive<'a>(
        &'a self,
        batch: &mut Batch<'a>,
        buffers: &Buffers,
        columns: u32,
        row: u32,
        step: u32,
    ) {
        if let Some(observe) = &self.observe {
            let params = Params { columns, stride: row, step, ..Params::default() };
            batch.push_columns(observe, &params);
        }
        if let Some(layers) = &buffers.layers {
            layers.forward(batch, &self.layers, columns, row);
        }
    }
}

/// What kernels are bound to.
struct Binder<'a> {
    flight: &'a Flight<'a>,
    compiled: &'a Compiled,
    inputs: &'a Inputs,
    buffers: &'a Buffers,
    /// Most columns of a chunk.
    columns: u32,
}

impl Binder<'_> {
    /// The kernels of `work` on the set of columns number `set`.
    fn kernels(&self, work: Work, set: usize) -> Result<Kernels> {
        let (rollout, after) = match work {
            Work::Measure => (Kernel::ReachAvoid, None),
            Work::Sign => (Kernel::ReachAvoid, Some(Kernel::Compact)),
            Work::Pairs => (Kernel::Deviation, Some(Kernel::Reduce)),
        };
        Ok(Kernels {
            sample: self.bind(Kernel::Sample, set, None)?,
            rollout: self.bind(rollout, set, None)?,
            after: after.map(|kernel| self.bind(kernel, set, None)).transpose()?,
            observe: self.observe(set)?,
            layers: self.layers(set)?,
            chain: self.chain(set)?,
        })
    }

    /// The kernel that evaluates what the network sees.
    fn observe(&self, set: usize) -> Result<Option<Bound>> {
        let bind = |seen| self.bind(Kernel::Observe, set, Some([seen, seen]));
        self.buffers.seen.as_ref().map(bind).transpose()
    }

    /// Formulas that call networks.
    fn chain(&self, set: usize) -> Result<Option<BoundChain>> {
        let Self { flight, compiled, inputs, buffers, .. } = *self;
        let both = compiled.text.chain().zip(buffers.chain.as_ref());
        let bind = |(chain, buffers)| {
            let state = self.buffers.of_set(Slot::State, set);
            ChainBinder { flight, compiled, inputs, buffers, state }.bind(chain)
        };
        both.map(bind).transpose()
    }

    /// The layers of the network.
    fn layers(&self, set: usize) -> Result<Vec<Bound>> {
        let Some(layers) = &self.buffers.layers else { return Ok(Vec::new()) };
        let state = self.buffers.of_set(Slot::State, set);
        let input = self.buffers.seen.as_ref().unwrap_or(state);
        layers.bind(input, |kernel, ends| self.bind(kernel, set, Some(ends)))
    }

    /// `kernel` with its buffers; `ends` are its source and its sink, where it has such.
    fn bind(&self, kernel: Kernel, set: usize, ends: Option<[&Buffer; 2]>) -> Result<Bound> {
        let pipeline = self.compiled.pipeline(&self.flight.device, kernel, self.columns)?;
        let buffer = |slot| match (slot, ends) {
            (Slot::Source, Some([source, _])) => source,
            (Slot::Sink, Some([_, sink])) => sink,
            (Slot::Weights, _) => {
                self.compiled.weights().unwrap_or(self.buffers.of(Slot::Measures))
            }
            (Slot::Control, _) => {
                let output = self.buffers.layers.as_ref().map(Layers::output);
                output.unwrap_or(self.buffers.of(Slot::Measures))
            }
            (Slot::Kept, _) => {
                let kept = self.buffers.chain.as_ref().map(ChainBuffers::kept);
                kept.unwrap_or(self.buffers.of(Slot::Measures))
            }
            (slot, _) => self.buffers.of_set(slot, set),
        };
        Ok(pipeline.bind(&self.flight.device, |slot| {
            self.inputs.binding(slot).unwrap_or_else(|| buffer(slot).binding())
        }))
    }
}
