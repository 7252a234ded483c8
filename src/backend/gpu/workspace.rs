//! The buffers of calls of one shape, and the kernels bound to them.

use super::batch::Batch;
use super::buffer::{Buffer, Use};
use super::chain::{BoundChain, ChainBinder, ChainBuffers, ChainStep};
use super::chain_load::ChainLoad;
use super::chunking::{Chunking, Work};
use super::compiled::Compiled;
use super::compose::{Kernel, PlantText, Slot, layer_dispatches};
use super::counting;
use super::flight::Flight;
use super::inputs::{InputSizes, Inputs};
use super::kernel::Bound;
use super::lists::{List, Listed};
use super::network::Layers;
use super::params::Params;
use super::readback::Turns;
use crate::backend::sink::Asked;
use crate::error::Result;
use crate::policy::Mlp;

/// What decides the sizes of all buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// What is asked of the rollouts.
    pub(super) work: Work,
    /// Whether each result is asked for.
    pub(super) asked: Asked,
    /// Whether the host lists the starts.
    pub(super) listed: bool,
    /// Steps.
    pub(super) horizon: u32,
    /// How the batch is cut up.
    pub(super) chunking: Chunking,
}

/// Offset of the measures in what is read back, bytes.
pub(super) const MEASURES_AT: u64 = 8;

/// Starts or pairs that are sent off together.
#[derive(Clone, Copy)]
pub(super) struct Chunk<'a> {
    pub(super) params: Params,
    /// Index of the first.
    pub(super) first: u64,
    /// The starts, where the host lists them.
    pub(super) list: Option<&'a List>,
}

/// Results on their way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    /// Index of their first start or pair.
    pub(super) first: u64,
    /// How many starts or pairs.
    pub(super) columns: u32,
    /// Whether none of their trajectories goes on.
    pub(super) ended: bool,
}

/// Buffers and kernels for one call at a time.
pub(super) struct Workspace {
    pub(super) shape: Shape,
    pub(super) inputs: Inputs,
    /// Where starts are that the host lists.
    pub(super) listed: Option<Listed>,
    pub(super) results: Turns<Sent>,
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
        let rows = compiled.text.rows();
        let (quads, chunking) = (compiled.text.states().div_ceil(4), shape.chunking);
        let layers = network.map_or(0, layer_dispatches);
        let chain = compiled.text.chain().map(ChainLoad::new);
        let chained = chain.map_or(0, |load| load.dispatches);
        // Each step with what its networks need; compaction or reduction.
        let segment = chunking.segment as usize * (layers + chained + 2) + 1;
        let sizes = InputSizes {
            values: compiled.text.parameters().div_ceil(4),
            schedule: rows as usize * (shape.horizon as usize + 1),
            region: 4 * quads,
            // The draw, segments, and what counts.
            dispatches: 2 + chunking.rounds_of(shape.horizon) as usize * segment,
            narrowed: if shape.work == Work::Sign { segment } else { 0 },
        };
        let inputs = Inputs::new(device, pool, sizes);
        let buffers = Buffers::new(flight, compiled, network, shape);
        let sets = if shape.work == Work::Sign { 2 } else { 1 };
        let room = || Listed::new(device, pool, compiled.text.states(), chunking.stride);
        let listed = shape.listed.then(room);
        let binder = Binder {
            flight,
            compiled,
            inputs: &inputs,
            listed: listed.as_ref(),
            buffers: &buffers,
            columns: chunking.stride,
        };
        let kernels = (0..sets).map(|set| binder.kernels(shape, set)).collect::<Result<_>>()?;
        let results = u64::from(shape.work.sides()) * 4 * u64::from(chunking.stride);
        let farthest = 8 * u64::from(rows) * (u64::from(shape.horizon) + 1);
        let results = Turns::new(device, pool, MEASURES_AT + results + farthest);
        Ok(Self { shape, inputs, listed, results, buffers, kernels })
    }

    /// Bytes of its buffers, without those of the results.
    pub(super) fn size(&self) -> u64 {
        self.inputs.size() + self.buffers.bytes + self.listed.as_ref().map_or(0, Listed::size)
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
        let sizes = sizes(shape, &compiled.text);
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
    pub(super) fn of_set(&self, slot: Slot, set: usize) -> &Buffer {
        let other = match slot {
            Slot::State => Slot::KeptState,
            Slot::Folds => Slot::KeptFolds,
            Slot::Origin => Slot::KeptOrigin,
            Slot::KeptState => Slot::State,
            Slot::KeptFolds => Slot::Folds,
            Slot::KeptOrigin => Slot::Origin,
            Slot::Survivors => Slot::Left,
            Slot::Left => Slot::Survivors,
            same => same,
        };
        self.of(if set == 0 { slot } else { other })
    }
}

/// Bytes of each buffer.
fn sizes(
    Shape { work, asked, horizon, chunking, .. }: Shape,
    text: &PlantText,
) -> Vec<(Slot, u64)> {
    let (states, rows) = (text.states(), u64::from(text.rows()));
    let (row, stride) = (u64::from(chunking.row), u64::from(chunking.stride));
    let state = 16 * states.div_ceil(4) as u64 * row;
    let measures = 4 * stride * u64::from(work.sides());
    let mut sizes = vec![
        (Slot::State, state),
        (Slot::Folds, 8 * row),
        (Slot::Origin, 4 * stride),
        (Slot::Measures, measures),
    ];
    if asked == Asked::Counts {
        let (starts, pairs) =
            (counting::measure_bytes(chunking.stride), counting::pair_bytes(chunking.stride));
        sizes.push((Slot::Counts, starts.max(pairs)));
    }
    match work {
        Work::Measure => {}
        Work::Sign => sizes.extend([
            (Slot::KeptState, state),
            (Slot::KeptFolds, 8 * row),
            (Slot::KeptOrigin, 4 * stride),
            (Slot::Survivors, 4),
            (Slot::Left, 4),
        ]),
        Work::Pairs => sizes.extend([
            (Slot::Distances, 4 * stride * rows * u64::from(chunking.segment)),
            (Slot::Farthest, 8 * rows * (u64::from(horizon) + 1)),
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
    /// Of signs: what sets dispatches on these columns to the trajectories that are left.
    pub(super) narrow: Option<Bound>,
    /// Where counts are asked for alone.
    pub(super) count: Option<Bound>,
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
    listed: Option<&'a Listed>,
    buffers: &'a Buffers,
    /// Most columns of a chunk.
    columns: u32,
}

impl Binder<'_> {
    /// The kernels of a shape on the set of columns number `set`.
    fn kernels(&self, Shape { work, asked, .. }: Shape, set: usize) -> Result<Kernels> {
        let (rollout, after) = match work {
            Work::Measure => (Kernel::ReachAvoid, None),
            Work::Sign => (Kernel::ReachAvoid, Some(Kernel::Compact)),
            Work::Pairs => (Kernel::Deviation, Some(Kernel::Reduce)),
        };
        let count = (asked == Asked::Counts).then_some(match work {
            Work::Measure | Work::Sign => Kernel::Count,
            Work::Pairs => Kernel::CountPairs,
        });
        let narrow = (work == Work::Sign).then_some(Kernel::Narrow);
        Ok(Kernels {
            sample: self.bind(Kernel::Sample, set, None)?,
            rollout: self.bind(rollout, set, None)?,
            after: after.map(|kernel| self.bind(kernel, set, None)).transpose()?,
            narrow: narrow.map(|kernel| self.bind(kernel, set, None)).transpose()?,
            count: count.map(|kernel| self.bind(kernel, set, None)).transpose()?,
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
        let listed = self.listed.filter(|_| kernel == Kernel::Sample);
        Ok(pipeline.bind(&self.flight.device, |slot| match (slot, listed) {
            (Slot::Region, Some(listed)) => listed.binding(),
            _ => self.inputs.binding(slot).unwrap_or_else(|| buffer(slot).binding()),
        }))
    }
}
