//! What the tasks share: uploads, bound kernels, batches of dispatches and their submission.

use std::cell::Cell;

use super::buffer::{Buffer, Params, Pool, Use};
use super::compose::{Access, Kernel, Shape, Slot, compose};
use super::device::Device;
use super::kernel::{Bound, Pipelines};
use super::opened::Opened;
use super::plan::{Plan, Size, Work, fused};
use super::recover::Attempt;
use super::timing::{Clock, Stamps};
use crate::backend::physics;
use crate::error::{Error, Result};
use crate::policy::{Mlp, Policy};
use crate::rollout::{Plant, Region, RolloutSpec, Starts, Tightening};
use crate::system::System;

/// `region_kind` of starts that the host uploads.
const REGION_LISTED: u32 = 2;

/// One call on the device.
pub(super) struct Call<'a> {
    pub(super) device: Device,
    pub(super) pool: &'a Pool,
    pipelines: &'a Pipelines,
    clock: &'a Clock,
    uniform: Buffer,
    in_flight: Cell<Option<wgpu::SubmissionIndex>>,
}

impl<'a> Call<'a> {
    /// A call with at most `dispatches` dispatches per submission.
    pub(super) fn new(opened: &'a Opened, dispatches: u64) -> Self {
        let bytes = dispatches * Params::PITCH as u64;
        // Before the first buffer is made: what fails from here on is this call's.
        let device = opened.device.for_call();
        Self {
            uniform: opened.pool.take(&device, Use::Uniform, bytes),
            device,
            pool: &opened.pool,
            pipelines: &opened.pipelines,
            clock: &opened.setup.clock,
            in_flight: Cell::new(None),
        }
    }

    /// A storage buffer.
    pub(super) fn storage(&self, bytes: u64) -> Buffer {
        self.pool.take(&self.device, Use::Storage, bytes)
    }

    /// A storage buffer with `data` in it.
    pub(super) fn uploaded(&self, data: &[[f32; 4]]) -> Buffer {
        let buffer = self.storage(size_of_val(data) as u64);
        buffer.write(&self.device, data);
        buffer
    }

    /// `kernel` of the text `composed` with its buffers.
    pub(super) fn bind<'b>(
        &'b self,
        kernel: Kernel,
        bindings: Vec<(Slot, Access)>,
        composed: String,
        buffer: impl Fn(Slot) -> &'b Buffer,
    ) -> Result<Bound> {
        let pipeline = self.pipelines.pipeline(&self.device, kernel, bindings, composed)?;
        Ok(pipeline.bind(&self.device, |slot| match slot {
            Slot::Params => self.uniform.first_block(),
            _ => buffer(slot).binding(),
        }))
    }

    /// Starts `batch`, after clearing `cleared`; at most two submissions are under way at a time.
    pub(super) fn submit(&self, batch: &Batch<'_>, cleared: Option<&Buffer>) -> Result<()> {
        self.uniform.write(&self.device, &batch.blocks);
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        if let Some(buffer) = cleared {
            buffer.clear(&mut encoder);
        }
        let stamps = self.clock.stamps(&self.device, self.pool, batch.calls.len());
        batch.encode(&mut encoder, stamps.as_ref());
        let index = self.device.submit(encoder.finish())?;
        if let Some(stamps) = &stamps {
            self.clock.add(&self.device, stamps, batch.kernels())?;
        }
        match self.in_flight.replace(Some(index)) {
            Some(before) => self.device.wait(Some(before)),
            None => self.device.check(),
        }
    }
}

/// A call that rolls a plant out.
pub(super) struct Job<'a> {
    pub(super) call: Call<'a>,
    pub(super) plan: Plan,
    shape: Shape,
    physics: String,
}

impl<'a> Job<'a> {
    /// The call for `count` starts or pairs under `plant`.
    pub(super) fn new<S, P, const NX: usize, const NU: usize>(
        (opened, attempt): (&'a Opened, &Attempt),
        plant: Plant<'_, S, P>,
        work: Work,
        count: u64,
    ) -> Result<Self>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let network = plant.policy.network();
        check_network(network, NX, NU)?;
        let adapter = &opened.device.adapter;
        let fused = fused(adapter, network, opened.setup.networks)?;
        let physics = physics(plant);
        let size = Size {
            states: NX,
            // A line of the text is an operation.
            flops: physics.lines().count() as u64,
            network,
            fused: fused.as_ref(),
            count,
        };
        let plan = Plan::new(adapter, attempt.limit, work, &size)?;
        attempt.columns.set(u64::from(plan.stride));
        // Per submission: the draw, compaction or reduction, and each step with its layers.
        let layers = network.map_or(0, |mlp| mlp.layers().len() as u64);
        Ok(Self {
            call: Call::new(opened, 2 + u64::from(plan.segment) * (layers + 1)),
            plan,
            shape: Shape { fused, ..Shape::new(NX, NU, network) },
            physics,
        })
    }

    /// `kernel` with its buffers.
    pub(super) fn bind<'b>(
        &'b self,
        kernel: Kernel,
        buffer: impl Fn(Slot) -> &'b Buffer,
    ) -> Result<Bound> {
        let bindings = self.shape.bindings(kernel);
        self.call.bind(kernel, bindings, compose(kernel, &self.shape, &self.physics), buffer)
    }

    /// Whether the rollouts run the layers of a network themselves.
    pub(super) fn fused(&self) -> bool {
        self.shape.fused.is_some()
    }

    /// Writes the listed starts `first..first + columns` into `state`; nothing if they are drawn.
    pub(super) fn upload_starts(
        &self,
        starts: &Starts<'_>,
        first: u64,
        columns: u32,
        state: &Buffer,
    ) {
        if !matches!(starts, Starts::Listed(_)) {
            return;
        }
        let row = self.plan.row as usize;
        let mut packed = vec![[0.0; 4]; starts.size().div_ceil(4) * row];
        for column in 0..columns as usize {
            let start = starts.start(first + column as u64);
            for (i, x) in start.into_iter().enumerate() {
                packed[i / 4 * row + column][i % 4] = x;
            }
        }
        state.write(&self.call.device, &packed);
    }
}

/// Dispatches of one submission and their parameters.
#[derive(Default)]
pub(super) struct Batch<'a> {
    blocks: Vec<u8>,
    calls: Vec<(&'a Bound, u32, [u32; 2])>,
}

impl<'a> Batch<'a> {
    /// Adds a dispatch of `groups` workgroups.
    pub(super) fn push(&mut self, bound: &'a Bound, params: &Params, groups: [u32; 2]) {
        self.calls.push((bound, self.blocks.len() as u32, groups));
        self.blocks.extend_from_slice(bytemuck::bytes_of(params));
        self.blocks.resize(self.blocks.len().next_multiple_of(Params::PITCH), 0);
    }

    /// Records the dispatches: in one pass, or in one each where they are timed.
    fn encode(&self, encoder: &mut wgpu::CommandEncoder, stamps: Option<&Stamps>) {
        let Some(stamps) = stamps else {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for (bound, offset, groups) in &self.calls {
                bound.dispatch(&mut pass, *offset, *groups);
            }
            return;
        };
        for (number, (bound, offset, groups)) in self.calls.iter().enumerate() {
            let mut pass = encoder.begin_compute_pass(&stamps.pass(number));
            bound.dispatch(&mut pass, *offset, *groups);
        }
        stamps.resolve(encoder);
    }

    /// The kernel of each dispatch.
    fn kernels(&self) -> impl Iterator<Item = &'static str> {
        self.calls.iter().map(|(bound, ..)| bound.kernel())
    }

    /// Number of dispatches.
    pub(super) fn len(&self) -> u64 {
        self.calls.len() as u64
    }

    /// Adds a dispatch with a thread per column.
    pub(super) fn push_columns(&mut self, kernel: Kernel, bound: &'a Bound, params: &Params) {
        let groups = params.columns.div_ceil(kernel.workgroup());
        self.push(bound, params, [groups, 1]);
    }
}

/// Parameters of the starts; the rest is 0.
pub(super) fn start_params(starts: &Starts<'_>, spec: &RolloutSpec) -> Params {
    let mut params =
        Params { horizon: spec.horizon, region_kind: REGION_LISTED, ..Params::default() };
    if let Starts::Drawn { region, stream } = starts {
        [params.key_low, params.key_high] = stream.key();
        params.stream = stream.id();
        params.region_kind = match region {
            Region::Box { .. } => 0,
            Region::Ball(_) => 1,
        };
    }
    params
}

/// One vector per coordinate, as `shaders/sample.wgsl` reads them.
pub(super) fn region_vectors(starts: &Starts<'_>) -> Vec<[f32; 4]> {
    let vector = |i: usize| match starts {
        Starts::Listed(_) => [0.0; 4],
        Starts::Drawn { region, .. } => match region {
            Region::Box { low, high } => [low[i], high[i] - low[i], 1.0, 0.0],
            Region::Ball(ball) => {
                let varies = f32::from(u8::from(ball.varies[i]));
                [ball.center[i], ball.radius, varies, 0.0]
            }
        },
    };
    (0..starts.size()).map(vector).collect()
}

/// Per step: discount, and what both margins lose. The discount is multiplied up step by step in
/// f32, as the host's fold does.
///
/// # Errors
/// [`Error::Invalid`] if the tightening has not one entry per step.
pub(super) fn schedule(spec: &RolloutSpec, tightening: &Tightening) -> Result<Vec<[f32; 4]>> {
    let rows = spec.horizon as usize + 1;
    if tightening.target.len() != rows || tightening.constraint.len() != rows {
        let (target, constraint) = (tightening.target.len(), tightening.constraint.len());
        let problem = format!(
            "{target} and {constraint} entries for the target and constraint margin; \
             a horizon of {} needs {rows} each",
            spec.horizon
        );
        return Err(Error::invalid("tightening", problem));
    }
    let losses = tightening.target.iter().zip(&tightening.constraint);
    let mut discount = 1.0;
    let row = |(&target, &constraint): (&f32, &f32)| {
        let row = [discount, target, constraint, 0.0];
        discount *= spec.gamma;
        row
    };
    Ok(losses.map(row).collect())
}

/// # Errors
/// [`Error::Invalid`] for an empty list of starts.
pub(super) fn check_starts(starts: &Starts<'_>) -> Result<()> {
    match starts {
        Starts::Listed(list) if list.is_empty() => {
            Err(Error::invalid("starts", "the list is empty"))
        }
        _ => Ok(()),
    }
}

/// The ends of a network must fit the plant: kernels do not check.
fn check_network(network: Option<&Mlp>, states: usize, controls: usize) -> Result<()> {
    let Some(widths) = network.map(Mlp::widths) else {
        return Ok(());
    };
    let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
    if (inputs, outputs) == (states, controls) {
        return Ok(());
    }
    let problem = format!(
        "maps {inputs} inputs to {outputs} outputs; the system has {states} states and \
         {controls} controls"
    );
    Err(Error::invalid("network", problem))
}
