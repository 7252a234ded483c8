//! How MPPI problems are cut up: samples and problems per chunk, rounds of a workgroup, steps per
//! dispatch.

use super::attempt::{COLUMN_UNIT, FORMULA_COLUMNS, Limit, MAX_TRIPS};
use super::chunking::{MEMORY_BYTES, NETWORK_COLUMNS};
use super::compose::{
    PARTIAL_HEADER, WORKGROUP, input_quads, layer_dispatches, layer_trips, output_quads,
    parameter_quads, tile_steps,
};
use super::listing::Adapter;
use super::network::network_flops;
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Workgroups that keep any GPU busy: beyond them a workgroup takes several rounds of samples, so
/// that fewer partials are read back.
const BUSY_GROUPS: u32 = 1024;
/// Iterations of Philox.
const PHILOX_TRIPS: u64 = 10;
/// Operations of one number of the noise: its part in a block of Philox and in a pair of normals.
const NOISE_FLOPS: u64 = 100;
/// Most dispatches of a submission, without those of a step that is under way.
pub(super) const DISPATCHES: u64 = 1024;
/// Bytes that an upload holds besides its problems: parameters of dispatches and of the model, and
/// what parts are rounded up by.
const OTHER_BYTES: u64 = 1 << 19;
/// Knots of a spline that a dispatch draws before its first step.
const WINDOW: u64 = 4;

/// A batch of problems, as far as it decides the chunks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size<'a> {
    /// Number of states.
    pub(super) states: usize,
    /// Number of controls.
    pub(super) controls: usize,
    /// Numbers of context per stage.
    pub(super) contexts: usize,
    /// Cells of the cost's maps; 0 without one.
    pub(super) cells: usize,
    /// Parameters of the model.
    pub(super) values: usize,
    /// Steps of a plan.
    pub(super) horizon: u32,
    /// Rows of a plan: its steps, and one for its end where that costs.
    pub(super) rows: u32,
    /// Samples of each problem.
    pub(super) samples: u32,
    /// Samples of a whole plan, of which those may be a range.
    pub(super) whole: u32,
    /// Problems.
    pub(super) problems: usize,
    /// Operations of the formulas for one step of one sample.
    pub(super) flops: u64,
    /// Value network and disturbance network.
    pub(super) networks: [Option<&'a Mlp>; 2],
}

impl Size<'_> {
    /// Bytes that the host sends for `problems` problems: parameters of the model, streams, starts,
    /// plans with their contexts.
    pub(super) fn parts(&self, problems: u64) -> [u64; 4] {
        let stages = 4 * problems * u64::from(self.rows);
        [
            16 * self.values.div_ceil(4) as u64,
            16 * problems,
            4 * problems * self.states as u64,
            stages * (self.controls + self.contexts) as u64,
        ]
    }

    /// Layers of all networks.
    fn layers(&self) -> u64 {
        self.networks.into_iter().flatten().map(|mlp| layer_dispatches(mlp) as u64).sum()
    }

    /// Operations of one step of one sample: formulas, noise and networks.
    pub(super) fn step_flops(&self) -> u64 {
        let networks = self.networks.into_iter().flatten().map(network_flops).sum::<u64>();
        self.flops + NOISE_FLOPS * self.controls as u64 + networks
    }
}

/// How the batch is cut up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MppiChunking {
    /// Problems of a chunk.
    pub(super) problems: u32,
    /// Samples of each problem in a chunk.
    pub(super) samples: u32,
    /// Columns of each problem: its samples and padding up to whole workgroups of the update.
    pub(super) width: u32,
    /// Columns that the buffers hold.
    pub(super) stride: u32,
    /// Samples of each thread of the update.
    pub(super) rounds: u32,
    /// Steps per dispatch of the rollout; 1 where there are networks, whose layers come between.
    pub(super) rollout_steps: u32,
    /// Steps per dispatch of the update.
    pub(super) update_steps: u32,
    /// Steps of rollout and update that a submission takes together.
    pub(super) timely_steps: u32,
}

impl MppiChunking {
    /// How to cut a batch on `adapter` within `limit`.
    ///
    /// # Errors
    /// [`Error::Device`] if not even the smallest chunk fits, or a kernel needs more loop
    /// iterations or threads than it may have.
    pub(super) fn new(adapter: &Adapter, limit: Limit, size: &Size<'_>) -> Result<Self> {
        let binding = adapter.max_binding_bytes.min(adapter.max_buffer_bytes);
        let networks = || size.networks.into_iter().flatten();
        let parameters = networks().map(|mlp| 16 * parameter_quads(mlp) as u64).max().unwrap_or(0);
        let columns = most_columns(size, binding, limit);
        let cells = 4 * size.cells as u64;
        // One upload holds them all, beside the parameters of the dispatches.
        let upload = (MEMORY_BYTES / 4).min(adapter.max_buffer_bytes);
        let problems = (binding / problem_row_bytes(size))
            .min(upload.saturating_sub(OTHER_BYTES) / problem_bytes(size))
            .min(size.problems.max(1) as u64);
        if columns == 0 || problems == 0 || parameters.max(cells) > binding {
            return Err(too_large(adapter, binding));
        }
        let rounds = rounds(size.whole);
        let block = u64::from(WORKGROUP * rounds);
        let whole = u64::from(size.samples).next_multiple_of(block);
        // A part of the samples is whole blocks, one at least whatever the time: blocks decide the bits.
        let width = whole.min((columns / block).max(1) * block);
        if width > fitting_columns(size, binding) {
            return Err(too_large(adapter, binding));
        }
        let samples = u64::from(size.samples).min(width);
        let problems = problems.min(columns / width).max(1);
        let stride = (problems * width).next_multiple_of(COLUMN_UNIT);
        // Rollout and update take every step once each.
        let timely = limit.pieces(stride * size.step_flops());
        let timely = timely.min(2 * u64::from(size.horizon)) as u32;
        Ok(Self {
            problems: problems as u32,
            samples: samples as u32,
            width: width as u32,
            stride: stride as u32,
            rounds,
            rollout_steps: rollout_steps(size)?.min(timely),
            update_steps: update_steps(size, rounds)?.min(timely),
            timely_steps: timely,
        })
    }
}

impl MppiChunking {
    /// Most dispatches of a submission.
    pub(super) fn dispatches(&self, size: &Size<'_>) -> u64 {
        let rollouts = u64::from(size.horizon.div_ceil(self.rollout_steps));
        let updates = u64::from(size.horizon.div_ceil(self.update_steps));
        let end = u64::from(size.rows - size.horizon);
        let all = 1 + rollouts * (1 + size.layers()) + end + updates;
        all.min(DISPATCHES + size.layers() + 1)
    }
}

/// Most columns of a chunk: whole tiles of the networks' layers.
fn most_columns(size: &Size<'_>, binding: u64, limit: Limit) -> u64 {
    let networked = size.networks.iter().any(Option::is_some);
    let cap = if networked { NETWORK_COLUMNS } else { FORMULA_COLUMNS };
    let timely = limit.pieces(size.step_flops()).max(COLUMN_UNIT);
    let fitting = fitting_columns(size, binding);
    fitting.min(cap).min(timely).min(limit.columns) / COLUMN_UNIT * COLUMN_UNIT
}

/// Columns that the memory holds.
fn fitting_columns(size: &Size<'_>, binding: u64) -> u64 {
    let parts = column_bytes(size);
    let largest = parts.iter().copied().max().unwrap_or(1);
    // A quarter of the memory is the problems'.
    (binding / largest).min(MEMORY_BYTES / 4 * 3 / parts.iter().sum::<u64>())
}

/// Bytes that each buffer holds per column: states, costs, correlated noise, partials of single
/// rounds, and for each network both buffers of activations.
fn column_bytes(size: &Size<'_>) -> Vec<u64> {
    let controls = size.controls as u64;
    let partial = 4 * (u64::from(PARTIAL_HEADER) + u64::from(size.horizon) * controls);
    let state = 16 * input_quads(size.states) as u64;
    let mut parts = vec![state, 4, 4 * controls, partial.div_ceil(u64::from(WORKGROUP))];
    for mlp in size.networks.into_iter().flatten() {
        let widths = mlp.layers().iter().map(|layer| output_quads(layer.outputs));
        let widest = 16 * widths.max().unwrap_or(0) as u64;
        parts.extend([widest, widest]);
    }
    parts
}

/// Bytes of a problem in its largest buffer.
fn problem_row_bytes(size: &Size<'_>) -> u64 {
    let stage = (size.controls + size.contexts) as u64;
    (4 * u64::from(size.rows) * stage).max(4 * size.states as u64).max(16)
}

/// Bytes of a problem in all of them: stream, start, plan and contexts.
fn problem_bytes(size: &Size<'_>) -> u64 {
    size.parts(1)[1..].iter().sum()
}

/// Samples of each thread of the update: a function of the samples of a whole plan alone, so that its bits depend
/// neither on the problems beside it nor on how its samples are cut up.
fn rounds(samples: u32) -> u32 {
    let groups = samples.div_ceil(WORKGROUP);
    let most = (groups / BUSY_GROUPS).max(1);
    // As few as the same number of workgroups needs: padding is work.
    groups.div_ceil(groups.div_ceil(most))
}

/// Loop iterations that drawing the noise of `steps` consecutive steps takes, the loop over the
/// steps included: an iteration per number, a block of Philox for every 4 of them and one that the
/// dispatch before used in part, an iteration per knot, and the correlated noise loaded and stored.
fn noise_trips(size: &Size<'_>, steps: u64) -> u64 {
    let controls = size.controls as u64;
    let draws = steps + WINDOW;
    let blocks = (draws * controls).div_ceil(4) + 1;
    steps + draws * (1 + controls) + (1 + PHILOX_TRIPS) * blocks + 2 * controls
}

/// Loop iterations of a thread of the update.
fn update_trips(size: &Size<'_>, rounds: u32, steps: u64) -> u64 {
    let tiles = steps.div_ceil(tile_steps(size.controls) as u64);
    let sums = tiles * (1 + u64::from(WORKGROUP));
    // Two passes over the costs, and two reductions over the workgroup.
    let reductions = 2 * (u64::from(rounds) + u64::from(WORKGROUP.ilog2()));
    reductions + u64::from(rounds) * (1 + noise_trips(size, steps) + sums)
}

/// Most steps of a dispatch of the rollout.
fn rollout_steps(size: &Size<'_>) -> Result<u32> {
    let networked = size.networks.iter().any(Option::is_some);
    let layer = size.networks.into_iter().flatten().map(layer_trips).max().unwrap_or(0);
    if layer > MAX_TRIPS {
        return Err(too_long(layer));
    }
    let most = if networked { 1 } else { size.horizon };
    most_steps(most, |steps| noise_trips(size, steps))
}

/// Most steps of a dispatch of the update.
fn update_steps(size: &Size<'_>, rounds: u32) -> Result<u32> {
    // A thread adds up the terms of one control of one step.
    if size.controls > WORKGROUP as usize {
        let problem = format!(
            "{} controls are more than the {WORKGROUP} threads of the MPPI update; use the native \
             CPU backend",
            size.controls
        );
        return Err(Error::Device(problem));
    }
    most_steps(size.horizon, |steps| update_trips(size, rounds, steps))
}

/// The largest number of steps, up to `most`, whose iterations a thread may spend.
fn most_steps(most: u32, trips: impl Fn(u64) -> u64) -> Result<u32> {
    let fits = |steps: &u32| trips(u64::from(*steps)) <= MAX_TRIPS;
    (1..=most).rev().find(fits).ok_or_else(|| too_long(trips(1)))
}

fn too_long(trips: u64) -> Error {
    Error::Device(format!(
        "a kernel would need {trips} loop iterations per thread for one step, and some drivers \
         stop at {MAX_TRIPS} without notice; use the native CPU backend for this size"
    ))
}

fn too_large(adapter: &Adapter, binding: u64) -> Error {
    Error::Device(format!(
        "{}: the networks, the map, one problem or the smallest chunk of samples do not fit the \
         adapter's limit of {binding} bytes per binding; use the native CPU backend",
        adapter.name
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(controls: usize, horizon: u32, samples: u32, problems: usize) -> Size<'static> {
        let networks = [None; 2];
        let (states, contexts, cells, values, flops) = (12, 8, 0, 6, 300);
        Size {
            states,
            controls,
            contexts,
            cells,
            values,
            horizon,
            rows: horizon,
            samples,
            whole: samples,
            problems,
            flops,
            networks,
        }
    }

    fn planned(adapter: &Adapter, size: &Size<'_>) -> Result<MppiChunking> {
        MppiChunking::new(adapter, Limit::default(), size)
    }

    /// Blocks of Philox that `steps` draws of `controls` numbers touch, from the worst place on.
    fn touched_blocks(controls: u64, steps: u64) -> u64 {
        let blocks = |first: u64| (first + steps * controls - 1) / 4 - first / 4 + 1;
        (0..4).map(blocks).max().unwrap_or(0)
    }

    #[test]
    fn trips_cover_what_the_kernels_count() {
        for controls in [1, 2, 3, 5, 12] {
            for steps in [1, 2, 20, 512] {
                let size = size(controls, 512, 64, 1);
                let controls = controls as u64;
                let steps_and_blocks =
                    steps * (1 + controls) + 11 * touched_blocks(controls, steps);
                assert!(noise_trips(&size, steps) >= steps_and_blocks + 2 * controls);
                // At most a knot per step after the first four.
                let knots = steps + 3;
                let spline = steps + knots * (1 + controls) + 11 * touched_blocks(controls, knots);
                assert!(noise_trips(&size, steps) >= spline, "{controls} {steps}");
            }
        }
        // 512 steps of 3 controls: 52 tiles of 10 steps, each 64 terms and itself.
        let whole = size(3, 512, 64, 1);
        let least = 52 * 65 + 512 * 4 + 11 * 384;
        assert!((least..2 * least).contains(&update_trips(&whole, 1, 512)));
    }

    #[test]
    fn chunks_stay_within_the_limits() {
        for samples in [1, 64, 65, 500, 16_384, 1_000_000] {
            for horizon in [1, 20, 512] {
                for (controls, problems) in [(1, 1), (3, 1), (3, 500), (12, 100_000)] {
                    let size = size(controls, horizon, samples, problems);
                    let chunking =
                        planned(&Adapter::made_up(1 << 27), &size).expect("a chunking that fits");
                    check(&size, &chunking, 1 << 27);
                }
            }
        }
    }

    #[test]
    fn an_upload_holds_its_problems_and_fits_a_buffer() {
        // A race's problem takes 16 + 48 + 20 * (12 + 32) bytes.
        let size = size(3, 20, 64, 100_000);
        let chunking = planned(&Adapter::made_up(1 << 22), &size).expect("a chunking that fits");
        let parts: u64 = size.parts(u64::from(chunking.problems)).iter().sum();
        assert!((1000..=(1 << 22) / 944).contains(&chunking.problems), "{chunking:?}");
        assert!(parts + 256 * chunking.dispatches(&size) <= 1 << 22, "{chunking:?}");
    }

    fn check(size: &Size<'_>, chunking: &MppiChunking, binding: u64) {
        let stride = u64::from(chunking.stride);
        assert_eq!(chunking.width % (WORKGROUP * chunking.rounds), 0, "{chunking:?}");
        assert!(
            chunking.width >= chunking.samples
                && chunking.problems * chunking.width <= chunking.stride
        );
        assert!(chunking.samples == size.samples || chunking.problems == 1, "{chunking:?}");
        assert_eq!(stride % COLUMN_UNIT, 0);
        let columns = column_bytes(size).into_iter().map(|bytes| bytes * stride);
        let problems = problem_bytes(size) * u64::from(chunking.problems);
        assert!(columns.clone().all(|bytes| bytes <= binding), "{chunking:?}");
        assert!(columns.sum::<u64>() + problems <= MEMORY_BYTES, "{chunking:?}");
        assert!(noise_trips(size, u64::from(chunking.rollout_steps)) <= MAX_TRIPS);
        let update = update_trips(size, chunking.rounds, u64::from(chunking.update_steps));
        assert!(update <= MAX_TRIPS, "{chunking:?}");
    }

    #[test]
    fn long_plans_are_split_over_dispatches() {
        let long = planned(&Adapter::made_up(1 << 27), &size(24, 512, 64, 1)).expect("a chunking");
        assert!((1..512).contains(&long.update_steps), "{long:?}");
        let race = planned(&Adapter::made_up(1 << 27), &size(3, 20, 500, 500)).expect("a chunking");
        assert_eq!((race.rollout_steps, race.update_steps), (20, 20));
    }

    /// A chunking must not depend on the problems beside it, nor its bits on how partials are cut.
    #[test]
    fn rounds_depend_on_the_samples_of_a_plan_alone() {
        for (samples, rounds) in [(500, 1), (65_536, 1), (200_000, 3), (1_000_000, 15)] {
            for problems in [1, 500] {
                for columns in [FORMULA_COLUMNS, 4096, 64] {
                    let limit = Limit { columns, ..Limit::default() };
                    let size = size(3, 20, samples, problems);
                    let adapter = Adapter::made_up(1 << 27);
                    let chunking = MppiChunking::new(&adapter, limit, &size).expect("it fits");
                    assert_eq!(chunking.rounds, rounds, "{samples} x {problems}, {columns}");
                    // A part ends where a block does.
                    let block = WORKGROUP * rounds;
                    let whole =
                        chunking.samples == samples || chunking.samples.is_multiple_of(block);
                    assert!(whole, "{chunking:?}");
                }
            }
        }
    }

    #[test]
    fn what_cannot_run_is_refused() {
        let small = planned(&Adapter::made_up(1 << 10), &size(3, 20, 500, 1));
        assert!(small.expect_err("no room").to_string().contains("1024 bytes"));
        let mapped = Size { cells: (1 << 25) + 1, ..size(3, 20, 500, 1) };
        let mapped = planned(&Adapter::made_up(1 << 27), &mapped);
        assert!(mapped.expect_err("no room for the map").to_string().contains("the map"));
        let wide = planned(&Adapter::made_up(1 << 27), &size(65, 20, 500, 1));
        assert!(wide.expect_err("too wide").to_string().contains("65 controls"));
        let long = most_steps(4, |steps| steps * MAX_TRIPS * 2);
        assert!(long.expect_err("too long").to_string().contains("loop iterations"));
    }
}
