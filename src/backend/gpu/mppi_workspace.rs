//! The buffers of MPPI calls of one shape, and the kernels bound to them.

use std::ops::Range;

use super::buffer::{Buffer, Use};
use super::compose::{Kernel, PARTIAL_HEADER, Slot};
use super::flight::Flight;
use super::kernel::Bound;
use super::mppi_chunking::MppiChunking;
use super::mppi_compiled::PlanCompiled;
use super::network::Layers;
use super::readback::Turns;
use super::upload::Upload;
use crate::error::Result;
use crate::rollout::{CostQuery, MppiProblem, NoiseShape};

/// Parts of the upload.
const VALUES: usize = 0;
const STREAMS: usize = 1;
const STARTS: usize = 2;
const PLANS: usize = 3;

/// What decides the sizes of all buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlanShape {
    /// How problems and samples are cut up.
    pub(super) chunking: MppiChunking,
    /// Whether the costs of samples are read.
    pub(super) costs: CostQuery,
}

/// What a submission of plans comes to.
#[derive(Clone, Debug)]
pub(super) struct SentPlans {
    /// How many problems.
    pub(super) problems: usize,
    pub(super) samples: Range<u32>,
    /// Words of the partials, which the costs follow.
    pub(super) partials: usize,
    /// Whether no more samples follow.
    pub(super) ended: bool,
}

/// Buffers and kernels for one call at a time.
pub(super) struct PlanWorkspace {
    pub(super) shape: PlanShape,
    pub(super) inputs: PlanInputs,
    pub(super) results: Turns<SentPlans>,
    pub(super) buffers: PlanBuffers,
    pub(super) kernels: PlanKernels,
    /// Bytes of its buffers, without those of the results.
    pub(super) bytes: u64,
}

impl PlanWorkspace {
    /// Buffers for `shape`, and the kernels of `compiled` bound to them.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn new(
        flight: &Flight<'_>,
        compiled: &PlanCompiled,
        shape: PlanShape,
    ) -> Result<Self> {
        let chunking = &shape.chunking;
        let size = compiled.source.size(chunking.problems as usize, chunking.samples);
        let parts = size.parts(u64::from(chunking.problems)).map(|bytes| bytes as usize);
        let dispatches = chunking.dispatches(&size) as usize;
        let upload = Upload::new(&flight.device, flight.pool, &parts, dispatches, 0);
        let mut inputs = PlanInputs(upload);
        inputs.0.put(VALUES, 0, &compiled.source.values);
        let buffers = PlanBuffers::new(flight, compiled, chunking);
        let kernels = Binder { flight, compiled, inputs: &inputs, buffers: &buffers }.kernels()?;
        let totals =
            if shape.costs == CostQuery::Each { 4 * u64::from(chunking.stride) } else { 0 };
        let results = buffers.of(Slot::Partials).size() + totals;
        let results = Turns::new(&flight.device, flight.pool, results);
        let bytes = inputs.0.size() + buffers.bytes;
        Ok(Self { shape, inputs, results, buffers, kernels, bytes })
    }
}

/// What the host sends with a submission of MPPI.
pub(super) struct PlanInputs(pub(super) Upload);

impl PlanInputs {
    /// Sets the problems of a chunk, plans of `horizon` stages with `rows` rows of contexts.
    pub(super) fn set(&mut self, problems: &[MppiProblem], horizon: usize, rows: usize) {
        let stream = |problem: &MppiProblem| {
            let [low, high] = problem.stream.key();
            [low, high, problem.stream.id(), problem.first_step]
        };
        let streams: Vec<[u32; 4]> = problems.iter().map(stream).collect();
        self.0.put(STREAMS, 0, &streams);
        for (number, MppiProblem { start, plan, context, .. }) in problems.iter().enumerate() {
            self.0.put(STARTS, number * start.len(), start);
            let Rows { stages, end } = Rows::new(horizon, rows, [plan, context]);
            self.0.put(PLANS, number * stages.len(), &stages);
            let behind = problems.len() * stages.len();
            self.0.put(PLANS, behind + number * end.len(), &end);
        }
    }

    /// What a kernel sees of it in `slot`; `None` for any other.
    fn binding(&self, slot: Slot) -> Option<wgpu::BufferBinding<'_>> {
        match slot {
            Slot::Params => Some(self.0.params()),
            Slot::Values => Some(self.0.part(VALUES)),
            Slot::Streams => Some(self.0.part(STREAMS)),
            Slot::Starts => Some(self.0.part(STARTS)),
            Slot::Plans => Some(self.0.part(PLANS)),
            _ => None,
        }
    }
}

/// The rows of a plan.
struct Rows {
    /// The nominal controls and the contexts of each stage, side by side.
    stages: Vec<f32>,
    /// The contexts of the end behind as many zeros as there are controls; none where it costs nothing.
    end: Vec<f32>,
}

impl Rows {
    /// Those of a plan of `horizon` stages, whose contexts have `rows` rows.
    fn new(horizon: usize, rows: usize, [plan, context]: [&[f32]; 2]) -> Self {
        let (controls, contexts) = (plan.len() / horizon, context.len() / rows);
        let stage = |t: usize| {
            let nominal = &plan[t * controls..][..controls];
            nominal.iter().chain(&context[t * contexts..][..contexts]).copied()
        };
        let end = |t: usize| [&vec![0.0; controls], &context[t * contexts..]].concat();
        Self {
            stages: (0..horizon).flat_map(stage).collect(),
            end: (horizon..rows).flat_map(end).collect(),
        }
    }
}

/// The buffers that only kernels write to.
pub(super) struct PlanBuffers {
    slots: Vec<(Slot, Buffer)>,
    /// Value network and disturbance network.
    pub(super) layers: [Option<Layers>; 2],
    bytes: u64,
}

impl PlanBuffers {
    fn new(flight: &Flight<'_>, compiled: &PlanCompiled, chunking: &MppiChunking) -> Self {
        let source = &compiled.source;
        let (spec, stride) = (&source.planning.spec, u64::from(chunking.stride));
        let quads = source.planning.model.states.len().div_ceil(4) as u64;
        let colored = matches!(spec.noise().shape(), NoiseShape::Colored { .. });
        let carry = if colored { 4 * spec.controls() as u64 * stride } else { 4 };
        let partials = u64::from(chunking.problems * groups(chunking)) * 4 * words(spec) as u64;
        let sizes = [
            (Slot::State, 16 * quads * stride),
            (Slot::Totals, 4 * stride),
            (Slot::Carry, carry),
            (Slot::Partials, partials),
        ];
        let take = |(slot, bytes)| (slot, flight.pool.take(&flight.device, Use::Storage, bytes));
        let slots: Vec<(Slot, Buffer)> = sizes.into_iter().map(take).collect();
        let layers = source.networks().map(|mlp| {
            mlp.map(|mlp| Layers::new(&flight.device, flight.pool, mlp, chunking.stride))
        });
        let own = slots.iter().map(|(_, buffer)| buffer.size()).sum::<u64>();
        let bytes = own + layers.iter().flatten().map(Layers::size).sum::<u64>();
        Self { slots, layers, bytes }
    }

    /// The buffer of `slot`.
    pub(super) fn of(&self, slot: Slot) -> &Buffer {
        let found = self.slots.iter().find(|(known, _)| *known == slot);
        // A kernel binds no more than there are buffers for.
        &found.unwrap_or(&self.slots[0]).1
    }
}

/// Workgroups of the update for each problem of a chunk.
pub(super) fn groups(chunking: &MppiChunking) -> u32 {
    chunking.width / (Kernel::MppiUpdate.workgroup() * chunking.rounds)
}

/// Numbers of a partial.
pub(super) fn words(spec: &crate::rollout::MppiSpec) -> usize {
    PARTIAL_HEADER as usize + spec.horizon() * spec.controls()
}

/// The kernels bound to the buffers of a workspace.
pub(super) struct PlanKernels {
    pub(super) start: Bound,
    pub(super) rollout: Bound,
    /// What the end costs, where it does.
    pub(super) terminal: Option<Bound>,
    pub(super) update: Bound,
    /// Layers of value network and disturbance network.
    pub(super) layers: [Vec<Bound>; 2],
}

/// What kernels are bound to.
struct Binder<'a> {
    flight: &'a Flight<'a>,
    compiled: &'a PlanCompiled,
    inputs: &'a PlanInputs,
    buffers: &'a PlanBuffers,
}

impl Binder<'_> {
    fn kernels(&self) -> Result<PlanKernels> {
        let terminal = self.compiled.source.planning.cost.terminal.is_some();
        Ok(PlanKernels {
            start: self.bind(Kernel::MppiStart)?,
            rollout: self.bind(Kernel::MppiRollout)?,
            terminal: terminal.then(|| self.bind(Kernel::MppiTerminal)).transpose()?,
            update: self.bind(Kernel::MppiUpdate)?,
            layers: [self.layers(0)?, self.layers(1)?],
        })
    }

    fn bind(&self, kernel: Kernel) -> Result<Bound> {
        let pipeline = self.compiled.pipeline(&self.flight.device, kernel, 0)?;
        let said = |network: usize| {
            let layers = self.buffers.layers[network].as_ref();
            layers.map_or(self.buffers.of(Slot::Totals), Layers::output)
        };
        let buffer = |slot| match slot {
            Slot::Spline => &self.compiled.spline,
            Slot::Cells => self.compiled.cells.as_ref().unwrap_or(&self.compiled.spline),
            Slot::Value => said(0),
            Slot::Push => said(1),
            slot => self.buffers.of(slot),
        };
        Ok(pipeline.bind(&self.flight.device, |slot| {
            self.inputs.binding(slot).unwrap_or_else(|| buffer(slot).binding())
        }))
    }

    /// The layers of the network number `network`, which reads the states.
    fn layers(&self, network: usize) -> Result<Vec<Bound>> {
        let layers = self.buffers.layers[network].as_ref();
        let (Some(layers), Some(weights)) = (layers, &self.compiled.weights[network]) else {
            return Ok(Vec::new());
        };
        layers.bind(self.buffers.of(Slot::State), |kernel, [source, sink]| {
            let pipeline = self.compiled.pipeline(&self.flight.device, kernel, network)?;
            Ok(pipeline.bind(&self.flight.device, |slot| match slot {
                Slot::Params => self.inputs.0.params(),
                Slot::Weights => weights.binding(),
                Slot::Source => source.binding(),
                _ => sink.binding(),
            }))
        })
    }
}
