//! How a batch is cut up: columns per chunk, steps per dispatch, steps per submission.

use super::attempt::{COLUMN_UNIT, FORMULA_COLUMNS, Limit};
use super::chain_load::ChainLoad;
use super::compose::{Fused, WORKGROUP, input_quads, output_quads, parameter_quads};
use super::device::{Adapter, AdapterKind};
use super::network::network_flops;
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Iterations that one invocation may spend, all its loops summed.
///
/// Mesa's lavapipe stops every invocation after 65,535 iterations without an error, its results
/// wrong; no other limit is known to be lower.
pub(super) const MAX_TRIPS: u64 = 60_000;

/// Most columns of a chunk under a network, which has a thread per 8 neurons of 8 columns.
pub(super) const NETWORK_COLUMNS: u64 = 1 << 14;
/// Most columns of a chunk whose rollouts run a network themselves, a workgroup of at least 64
/// threads per 64 columns: enough for any GPU, and not too long a dispatch for the watchdog of a
/// slow one.
const FUSED_COLUMNS: u64 = 1 << 16;
/// Widest network that rollouts run themselves: beyond, its activations leave no room for a second
/// workgroup, and its parameters do not stay in the caches.
const FUSED_WIDTH: usize = 128;
/// Most device memory of one call, bytes.
pub(super) const MEMORY_BYTES: u64 = 256 << 20;

/// What is asked of the rollouts, as far as it decides the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// Measures of trajectories.
    Measure,
    /// Signs of trajectories: the set of open ones is compacted after each submission.
    Sign,
    /// Pairs, whose distances are reduced after each submission.
    Pairs,
}

impl Work {
    /// Steps per submission.
    fn segment(self, driven: Driven) -> u32 {
        match (self, driven) {
            (Self::Measure, Driven::Formula) => 256,
            (Self::Measure, Driven::Layered) => 64,
            (Self::Sign, Driven::Layered | Driven::Fused) => 8,
            (Self::Sign, Driven::Formula) | (Self::Measure, Driven::Fused) | (Self::Pairs, _) => 32,
        }
    }

    /// Trajectories of a column.
    pub(super) fn sides(self) -> u32 {
        if self == Self::Pairs { 2 } else { 1 }
    }
}

/// What drives the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Driven {
    /// A formula.
    Formula,
    /// Networks, the one that drives or those that formulas call: dispatches between the steps.
    Layered,
    /// A network that the rollouts run themselves.
    Fused,
}

impl Driven {
    fn new(size: &Size<'_>) -> Self {
        match (size.network, size.fused, size.chain) {
            (_, _, Some(_)) | (Some(_), None, None) => Self::Layered,
            (None, _, None) => Self::Formula,
            (Some(_), Some(_), None) => Self::Fused,
        }
    }

    /// Most columns of a chunk.
    fn columns(self) -> u64 {
        match self {
            Self::Formula => FORMULA_COLUMNS,
            Self::Layered => NETWORK_COLUMNS,
            Self::Fused => FUSED_COLUMNS,
        }
    }
}

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
        && step_trips(&fused, Work::Pairs) <= MAX_TRIPS;
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

/// Loop iterations of a thread for one step that runs the network itself.
fn step_trips(fused: &Fused, work: Work) -> u64 {
    1 + u64::from(work.sides()) * fused.trips()
}

/// A batch, as far as it decides the plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size<'a> {
    /// States of the system.
    pub(super) states: usize,
    /// Operations of the formulas for one step of one trajectory.
    pub(super) flops: u64,
    /// The network that drives the rollouts.
    pub(super) network: Option<&'a Mlp>,
    /// The same, where they run it themselves.
    pub(super) fused: Option<&'a Fused>,
    /// What formulas that call networks cost, where some do.
    pub(super) chain: Option<&'a ChainLoad>,
    /// Numbers that the network sees, where a kernel of its own evaluates them; 0 where it sees the
    /// states.
    pub(super) seen: usize,
    /// Starts or pairs.
    pub(super) count: u64,
}

impl Size<'_> {
    /// Operations of a step of one trajectory.
    fn step_flops(&self) -> u64 {
        let called = self.chain.map_or(0, |load| load.flops);
        self.flops + self.network.map_or(0, network_flops) + called
    }
}

/// How a batch is cut up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Columns of a chunk: trajectories or pairs.
    pub(super) stride: u32,
    /// Trajectories in each row of the state: `stride`, or twice that for pairs.
    pub(super) row: u32,
    /// Steps per submission.
    pub(super) segment: u32,
    /// Steps per dispatch: 1 if a network's layers come between, else as many of a segment as the
    /// bound on loop iterations allows.
    pub(super) steps: u32,
}

impl Plan {
    /// The plan for a batch on `adapter` within `limit`.
    ///
    /// # Errors
    /// [`Error::Device`] if not even the smallest chunk fits.
    pub(super) fn new(
        adapter: &Adapter,
        limit: Limit,
        work: Work,
        size: &Size<'_>,
    ) -> Result<Self> {
        let Size { states, network, fused, seen, count, chain, .. } = *size;
        let driven = Driven::new(size);
        let segment = work.segment(driven);
        let layered = network.filter(|_| driven == Driven::Layered);
        let mut parts = column_bytes(work, (states, seen), layered, segment);
        let called = chain.map_or([0; 5], |load| load.bytes);
        parts.extend(called.map(|bytes| bytes * u64::from(work.sides())));
        let largest = parts.iter().copied().max().unwrap_or(1);
        let binding = adapter.max_binding_bytes.min(adapter.max_buffer_bytes);
        let fitting = (binding / largest).min(MEMORY_BYTES / parts.iter().sum::<u64>());
        // A step of the smallest chunk is what there is at least.
        let step_flops = u64::from(work.sides()) * size.step_flops();
        let timely = limit.pieces(step_flops).max(COLUMN_UNIT);
        let wanted = count.max(1).next_multiple_of(COLUMN_UNIT).min(driven.columns());
        let most = fitting.min(timely).min(limit.columns);
        let stride = wanted.min(most / COLUMN_UNIT * COLUMN_UNIT);
        let parameters = 16 * network.map_or(0, parameter_quads) as u64;
        let parameters = parameters.max(chain.map_or(0, |load| load.parameters));
        if stride == 0 || parameters > binding {
            return Err(too_large(adapter, largest * COLUMN_UNIT, parameters, binding));
        }
        let segment = u64::from(segment).min(limit.pieces(stride * step_flops)) as u32;
        let steps = match (driven, fused) {
            (Driven::Layered, _) => 1,
            (_, Some(fused)) => segment.min((MAX_TRIPS / step_trips(fused, work)) as u32),
            (_, None) => segment,
        };
        let trips = longest_trips(states, layered, stride, u64::from(steps));
        let trips = trips.max(chain.map_or(0, |load| load.inputs));
        if trips > MAX_TRIPS {
            return Err(Error::Device(format!(
                "a kernel would need {trips} loop iterations per thread, and some drivers stop \
                 at {MAX_TRIPS} without notice; use the native CPU backend for this size"
            )));
        }
        Ok(Self { stride: stride as u32, row: stride as u32 * work.sides(), segment, steps })
    }
}

/// Bytes that each buffer holds per column.
fn column_bytes(
    work: Work,
    (states, seen): (usize, usize),
    network: Option<&Mlp>,
    segment: u32,
) -> Vec<u64> {
    let sides = u64::from(work.sides());
    let state = 16 * input_quads(states) as u64 * sides;
    let (folds, origin, measure) = (8 * sides, 4, 4 * sides);
    let mut parts = vec![state, folds, origin, measure];
    match work {
        Work::Measure => {}
        Work::Sign => parts.extend([state, folds, origin]),
        Work::Pairs => parts.push(4 * u64::from(segment)),
    }
    if let Some(mlp) = network {
        let widths = mlp.layers().iter().map(|layer| output_quads(layer.outputs));
        let widest = 16 * widths.max().unwrap_or(0) as u64 * sides;
        parts.extend([widest, widest, 16 * input_quads(seen) as u64 * sides]);
    }
    parts
}

/// Most loop iterations of one invocation of any kernel of the plan, `network` in layers.
fn longest_trips(states: usize, network: Option<&Mlp>, stride: u64, steps: u64) -> u64 {
    let states = states as u64;
    // Philox takes 10 iterations per 4 words; a start and its perturbation run over the states
    // at most 4 times each, and over half as many pairs.
    let blocks = states.div_ceil(4) + 2;
    let sample = 2 * (10 * blocks + 5 * states);
    let layers = network.into_iter().flat_map(Mlp::layers);
    let layer = layers.map(|layer| input_quads(layer.inputs) as u64).max();
    let reduce = stride.div_ceil(u64::from(WORKGROUP)) + 8;
    let compact = states.div_ceil(4);
    [sample, layer.unwrap_or(0), reduce, compact, steps].into_iter().max().unwrap_or(0)
}

fn too_large(adapter: &Adapter, columns: u64, parameters: u64, binding: u64) -> Error {
    Error::Device(format!(
        "{}: a network of {parameters} bytes, or {columns} bytes for the smallest chunk, do not \
         fit the adapter's limit of {binding} bytes per binding; use the native CPU backend",
        adapter.name
    ))
}

#[cfg(test)]
mod tests {
    use super::super::attempt::WORK_FLOPS;
    use super::*;
    use crate::policy::{Activation, Layer, OutputActivation};

    fn network(widths: &[usize]) -> Mlp {
        let layer = |pair: &[usize]| Layer {
            weight: vec![0.0; pair[0] * pair[1]],
            bias: vec![0.0; pair[1]],
            inputs: pair[0],
            outputs: pair[1],
        };
        let layers = widths.windows(2).map(layer).collect();
        Mlp::new(layers, Activation::Relu, OutputActivation::Tanh).expect("a whole network")
    }

    fn size<'a>(
        states: usize,
        (network, fused): (Option<&'a Mlp>, Option<&'a Fused>),
        count: u64,
    ) -> Size<'a> {
        Size { states, flops: 200, network, fused, chain: None, seen: 0, count }
    }

    fn planned(adapter: &Adapter, work: Work, size: &Size<'_>) -> Result<Plan> {
        Plan::new(adapter, Limit::default(), work, size)
    }

    #[test]
    fn chunks_are_whole_tiles_within_the_limits() {
        let (wide, narrow) = (network(&[12, 512, 512, 3]), network(&[12, 64, 64, 3]));
        for (binding, count) in [(1 << 27, 1), (1 << 27, u64::MAX / 2), (1 << 20, 100_000_000)] {
            for network in [None, Some(&wide), Some(&narrow)] {
                let fused = network.filter(|mlp| *mlp == &narrow).map(Fused::new);
                for work in [Work::Measure, Work::Sign, Work::Pairs] {
                    // Parameters of the wide network take a megabyte of their own.
                    let binding = binding + if network.is_some() { 1 << 21 } else { 0 };
                    let size = size(12, (network, fused.as_ref()), count);
                    let plan = planned(&Adapter::made_up(binding), work, &size);
                    let plan = plan.expect("a plan within the limits");
                    let layered = network.filter(|_| fused.is_none());
                    let bytes = column_bytes(work, (12, 0), layered, plan.segment);
                    let stride = u64::from(plan.stride);
                    assert_eq!(stride % COLUMN_UNIT, 0);
                    assert!(bytes.iter().all(|bytes| bytes * stride <= binding));
                    assert!(bytes.iter().sum::<u64>() * stride <= MEMORY_BYTES);
                    let step = fused.as_ref().map_or(1, |fused| step_trips(fused, work));
                    assert!(u64::from(plan.steps) * step <= MAX_TRIPS);
                    assert_eq!(plan.steps == 1, layered.is_some());
                    let flops = stride * u64::from(work.sides() * plan.segment);
                    assert!(flops * size.step_flops() <= WORK_FLOPS, "{plan:?}");
                }
            }
        }
    }

    #[test]
    fn small_batches_get_small_chunks() {
        let size = size(12, (None, None), 468);
        let plan = planned(&Adapter::made_up(1 << 27), Work::Measure, &size);
        assert_eq!(plan.expect("a plan").stride, 512);
    }

    #[test]
    fn what_cannot_run_is_refused() {
        let formula = |states| size(states, (None, None), 10);
        let small = planned(&Adapter::made_up(1 << 10), Work::Measure, &formula(12));
        assert!(matches!(small, Err(Error::Device(_))), "{small:?}");
        let states = 4 * MAX_TRIPS as usize;
        let long = planned(&Adapter::made_up(1 << 30), Work::Measure, &formula(states));
        let text = long.expect_err("too many iterations").to_string();
        assert!(text.contains("loop iterations"), "{text}");
    }

    #[test]
    fn a_submission_has_no_more_work_than_a_watchdog_allows() {
        let wide = network(&[12, 64, 64, 3]);
        let size = size(12, (Some(&wide), None), 1 << 20);
        let step = size.step_flops();
        for (pieces, expected) in
            [(1 << 20, (1 << 14, 64)), (1 << 15, (1 << 14, 2)), (100, (64, 1))]
        {
            let limit = Limit { flops: pieces * step, ..Limit::default() };
            let plan = Plan::new(&Adapter::made_up(1 << 27), limit, Work::Measure, &size);
            let plan = plan.expect("a plan");
            assert_eq!((plan.stride, plan.segment), expected, "{pieces} trajectories and steps");
        }
    }

    #[test]
    fn half_a_limit_is_smaller_until_there_is_none() {
        let mut limit = Limit::default();
        let mut columns = FORMULA_COLUMNS;
        while let Some(half) = limit.half(columns) {
            assert!(half.columns <= columns / 2 && half.flops == limit.flops / 2);
            assert_eq!(half.columns % COLUMN_UNIT, 0);
            (limit, columns) = (half, half.columns);
            let plan = Plan::new(
                &Adapter::made_up(1 << 27),
                limit,
                Work::Pairs,
                &size(12, (None, None), u64::MAX / 2),
            );
            assert_eq!(u64::from(plan.expect("a plan").stride), columns);
        }
        assert_eq!(columns, COLUMN_UNIT);
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

    #[test]
    fn deep_fused_networks_take_fewer_steps_per_dispatch() {
        let deep = network(&[[12].as_slice(), &[128; 60], &[3]].concat());
        let fused = Fused::new(&deep);
        let adapter = Adapter::made_up(1 << 27);
        let size = size(12, (Some(&deep), Some(&fused)), 1000);
        let limit = Limit { flops: u64::MAX, ..Limit::default() };
        let plan = Plan::new(&adapter, limit, Work::Measure, &size);
        // 3 vectors of inputs, then 60 times 32, and the 61 layers themselves.
        let trips = 1 + 3 + 60 * 32 + 61;
        assert_eq!(u64::from(plan.expect("a plan").steps), MAX_TRIPS / trips);
    }
}
