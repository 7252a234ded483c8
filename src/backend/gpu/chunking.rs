//! How a batch is cut up: columns per chunk, steps per dispatch, steps per submission.

use super::attempt::{COLUMN_UNIT, FORMULA_COLUMNS, Limit, MAX_TRIPS};
use super::chain_load::ChainLoad;
use super::compose::{
    Fused, WORKGROUP, input_quads, layer_dispatches, layer_trips, output_quads, parameter_quads,
};
use super::fusing::step_trips;
use super::listing::Adapter;
use super::network::network_flops;
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Most columns of a chunk under a network, which has a thread per 8 neurons of 8 columns.
pub(super) const NETWORK_COLUMNS: u64 = 1 << 14;
/// Most columns of a chunk whose rollouts run a network themselves, a workgroup of at least 64
/// threads per 64 columns: enough for any GPU, and not too long a dispatch for the watchdog of a
/// slow one.
const FUSED_COLUMNS: u64 = 1 << 16;
/// Most dispatches of a submission of signs, whose trajectories may all be decided by then.
const DISPATCHES: u64 = 1024;
/// Most device memory of one call, bytes.
pub(super) const MEMORY_BYTES: u64 = 256 << 20;

/// What is asked of the rollouts, as far as it decides the chunking.
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
    fn segment(self, driven_by: DrivenBy) -> u32 {
        match (self, driven_by) {
            (Self::Measure, DrivenBy::Formula) => 256,
            (Self::Measure, DrivenBy::Layered) => 64,
            (Self::Sign, DrivenBy::Layered | DrivenBy::Fused) => 8,
            (Self::Sign, DrivenBy::Formula)
            | (Self::Measure, DrivenBy::Fused)
            | (Self::Pairs, _) => 32,
        }
    }

    /// Trajectories of a column.
    pub(super) fn sides(self) -> u32 {
        if self == Self::Pairs { 2 } else { 1 }
    }
}

/// What drives the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DrivenBy {
    /// A formula.
    Formula,
    /// Networks, the one that drives or those that formulas call: dispatches between the steps.
    Layered,
    /// A network that the rollouts run themselves.
    Fused,
}

impl DrivenBy {
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

/// A batch, as far as it decides the chunking.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size<'a> {
    /// States of the system.
    pub(super) states: usize,
    /// Operations of the formulas for one step of one trajectory.
    pub(super) flops: u64,
    /// Parts of a period, each a loop iteration.
    pub(super) points: u32,
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
    /// Most dispatches of a step: the rollout, what its network sees, layers and links.
    pub(super) fn step_dispatches(&self) -> u64 {
        let layers = self.network.map_or(0, layer_dispatches);
        let chained = self.chain.map_or(0, |load| load.dispatches);
        (2 + layers + chained) as u64
    }

    /// Most steps of a dispatch whose rollouts run the network `fused` themselves, or none.
    fn most_steps(&self, fused: Option<&Fused>, work: Work) -> u32 {
        let driven = fused.map_or(1, |fused| step_trips(fused, work.sides()));
        let trips = driven + u64::from(self.points) - 1;
        (MAX_TRIPS / trips).max(1) as u32
    }

    /// Operations of a step of one trajectory.
    fn step_flops(&self) -> u64 {
        let called = self.chain.map_or(0, |load| load.flops);
        self.flops + self.network.map_or(0, network_flops) + called
    }
}

/// How a batch is cut up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chunking {
    /// Columns of a chunk: trajectories or pairs.
    pub(super) stride: u32,
    /// Trajectories in each row of the state: `stride`, or twice that for pairs.
    pub(super) row: u32,
    /// Steps per submission, of signs per compaction.
    pub(super) segment: u32,
    /// Segments per submission: 1 but for signs.
    pub(super) rounds: u32,
    /// Steps per dispatch: 1 if a network's layers come between, else as many of a segment as the
    /// bound on loop iterations allows.
    pub(super) steps: u32,
}

impl Chunking {
    /// The chunking for a batch on `adapter` within `limit`.
    ///
    /// # Errors
    /// [`Error::Device`] if not even the smallest chunk fits.
    pub(super) fn new(
        adapter: &Adapter,
        limit: Limit,
        work: Work,
        size: &Size<'_>,
    ) -> Result<Self> {
        let Size { network, fused, count, chain, .. } = *size;
        let driven_by = DrivenBy::new(size);
        let segment = work.segment(driven_by);
        let layered = network.filter(|_| driven_by == DrivenBy::Layered);
        let mut parts = column_bytes(work, size, layered, segment);
        let called = chain.map_or([0; 5], |load| load.bytes);
        parts.extend(called.map(|bytes| bytes * u64::from(work.sides())));
        let largest = parts.iter().copied().max().unwrap_or(1);
        let binding = adapter.max_binding_bytes.min(adapter.max_buffer_bytes);
        let fitting = (binding / largest).min(MEMORY_BYTES / parts.iter().sum::<u64>());
        // A step of the smallest chunk is what there is at least.
        let step_flops = u64::from(work.sides()) * size.step_flops();
        let timely = limit.pieces(step_flops).max(COLUMN_UNIT);
        let wanted = count.max(1).next_multiple_of(COLUMN_UNIT).min(driven_by.columns());
        let most = fitting.min(timely).min(limit.columns);
        let stride = wanted.min(most / COLUMN_UNIT * COLUMN_UNIT);
        let parameters = 16 * network.map_or(0, parameter_quads) as u64;
        let parameters = parameters.max(chain.map_or(0, |load| load.parameters));
        if stride == 0 || parameters > binding {
            return Err(too_large(adapter, largest * COLUMN_UNIT, parameters, binding));
        }
        let timely = limit.pieces(stride * step_flops);
        let segment = u64::from(segment).min(timely) as u32;
        let rounds = match work {
            Work::Sign => rounds(size, timely, segment),
            Work::Measure | Work::Pairs => 1,
        };
        let steps = match (driven_by, fused) {
            (DrivenBy::Layered, _) => 1,
            (_, fused) => segment.min(size.most_steps(fused, work)),
        };
        let iterations = u64::from(steps) * u64::from(size.points);
        let trips = longest_trips(size.states, layered, stride, iterations);
        let trips = trips.max(chain.map_or(0, |load| load.inputs));
        if trips > MAX_TRIPS {
            return Err(Error::Device(format!(
                "a kernel would need {trips} loop iterations per thread, and some drivers stop \
                 at {MAX_TRIPS} without notice; use the native CPU backend for this size"
            )));
        }
        Ok(Self {
            stride: stride as u32,
            row: stride as u32 * work.sides(),
            segment,
            rounds,
            steps,
        })
    }

    /// Segments of a submission of rollouts of `horizon` steps.
    pub(super) fn rounds_of(&self, horizon: u32) -> u32 {
        self.rounds.min((horizon + 1).div_ceil(self.segment))
    }
}

/// Segments of `segment` steps that a submission of `timely` steps takes.
fn rounds(size: &Size<'_>, timely: u64, segment: u32) -> u32 {
    let dispatches = u64::from(segment) * size.step_dispatches() + 2;
    (timely / u64::from(segment)).min(DISPATCHES / dispatches).max(1) as u32
}

/// Bytes that each buffer holds per column.
fn column_bytes(work: Work, size: &Size<'_>, network: Option<&Mlp>, segment: u32) -> Vec<u64> {
    let Size { states, seen, points, .. } = *size;
    let sides = u64::from(work.sides());
    let state = 16 * input_quads(states) as u64 * sides;
    let (folds, origin, measure) = (8 * sides, 4, 4 * sides);
    let mut parts = vec![state, folds, origin, measure];
    match work {
        Work::Measure => {}
        Work::Sign => parts.extend([state, folds, origin]),
        // Distances of samples, and of the points behind them.
        Work::Pairs => parts.push(4 * u64::from(segment) * u64::from(points.min(2))),
    }
    if let Some(mlp) = network {
        let widths = mlp.layers().iter().map(|layer| output_quads(layer.outputs));
        let widest = 16 * widths.max().unwrap_or(0) as u64 * sides;
        parts.extend([widest, widest, 16 * input_quads(seen) as u64 * sides]);
    }
    parts
}

/// Most loop iterations of one invocation of any kernel of the chunking, `network` in layers.
fn longest_trips(states: usize, network: Option<&Mlp>, stride: u64, steps: u64) -> u64 {
    let states = states as u64;
    // Philox takes 10 iterations per 4 words; a start and its perturbation run over the states
    // at most 4 times each, and over half as many pairs.
    let blocks = states.div_ceil(4) + 2;
    let sample = 2 * (10 * blocks + 5 * states);
    let layer = network.map(layer_trips);
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
    use super::super::compose::Form;
    use super::super::fusing::tests::network;
    use super::*;

    const TILES: Form = Form::Tiles { trajectories: 64, neurons: 8, columns: 8 };

    fn size<'a>(
        states: usize,
        network: Option<&'a Mlp>,
        fused: Option<&'a Fused>,
        count: u64,
    ) -> Size<'a> {
        Size { states, flops: 200, points: 1, network, fused, chain: None, seen: 0, count }
    }

    fn planned(adapter: &Adapter, work: Work, size: &Size<'_>) -> Result<Chunking> {
        Chunking::new(adapter, Limit::default(), work, size)
    }

    #[test]
    fn chunks_are_whole_tiles_within_the_limits() {
        let (wide, narrow) = (network(&[12, 512, 512, 3]), network(&[12, 64, 64, 3]));
        for (binding, count) in [(1 << 27, 1), (1 << 27, u64::MAX / 2), (1 << 20, 100_000_000)] {
            for network in [None, Some(&wide), Some(&narrow)] {
                let fused =
                    network.filter(|mlp| *mlp == &narrow).and_then(|mlp| Fused::new(mlp, TILES));
                for work in [Work::Measure, Work::Sign, Work::Pairs] {
                    // Parameters of the wide network take a megabyte of their own.
                    let binding = binding + if network.is_some() { 1 << 21 } else { 0 };
                    let size = size(12, network, fused.as_ref(), count);
                    let chunking = planned(&Adapter::made_up(binding), work, &size);
                    let chunking = chunking.expect("a chunking within the limits");
                    let layered = network.filter(|_| fused.is_none());
                    let bytes = column_bytes(work, &size, layered, chunking.segment);
                    let stride = u64::from(chunking.stride);
                    assert_eq!(stride % COLUMN_UNIT, 0);
                    assert!(bytes.iter().all(|bytes| bytes * stride <= binding));
                    assert!(bytes.iter().sum::<u64>() * stride <= MEMORY_BYTES);
                    let step = fused.as_ref().map_or(1, |fused| step_trips(fused, work.sides()));
                    assert!(u64::from(chunking.steps) * step <= MAX_TRIPS);
                    assert_eq!(chunking.steps == 1, layered.is_some());
                    let flops = stride * u64::from(work.sides() * chunking.segment);
                    assert!(flops * size.step_flops() <= WORK_FLOPS, "{chunking:?}");
                }
            }
        }
    }

    #[test]
    fn small_batches_get_small_chunks() {
        let size = size(12, None, None, 468);
        let chunking = planned(&Adapter::made_up(1 << 27), Work::Measure, &size);
        assert_eq!(chunking.expect("a chunking").stride, 512);
    }

    #[test]
    fn what_cannot_run_is_refused() {
        let formula = |states| size(states, None, None, 10);
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
        let size = size(12, Some(&wide), None, 1 << 20);
        let step = size.step_flops();
        for (pieces, expected) in
            [(1 << 20, (1 << 14, 64)), (1 << 15, (1 << 14, 2)), (100, (64, 1))]
        {
            let limit = Limit { flops: pieces * step, ..Limit::default() };
            let chunking = Chunking::new(&Adapter::made_up(1 << 27), limit, Work::Measure, &size);
            let chunking = chunking.expect("a chunking");
            assert_eq!(
                (chunking.stride, chunking.segment),
                expected,
                "{pieces} trajectories and steps"
            );
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
            let chunking = Chunking::new(
                &Adapter::made_up(1 << 27),
                limit,
                Work::Pairs,
                &size(12, None, None, u64::MAX / 2),
            );
            assert_eq!(u64::from(chunking.expect("a chunking").stride), columns);
        }
        assert_eq!(columns, COLUMN_UNIT);
    }

    #[test]
    fn deep_fused_networks_take_fewer_steps_per_dispatch() {
        let deep = network(&[[12].as_slice(), &[128; 60], &[3]].concat());
        let fused = Fused::new(&deep, TILES).expect("tiles fit any network");
        let adapter = Adapter::made_up(1 << 27);
        let size = size(12, Some(&deep), Some(&fused), 1000);
        let limit = Limit { flops: u64::MAX, ..Limit::default() };
        let chunking = Chunking::new(&adapter, limit, Work::Measure, &size);
        // 12 inputs padded to 16, then 60 times 128, and the 61 layers themselves.
        let trips = 1 + 16 + 60 * 128 + 61;
        assert_eq!(u64::from(chunking.expect("a chunking").steps), MAX_TRIPS / trips);
    }
}
