//! The batch of growing size: starts drawn from the default box of the race.

use std::hint::black_box;

use super::data;
use crate::backend::Backend;
use crate::bench;
use crate::error::Result;
use crate::policy::Mlp;
use crate::race::system::DroneRace;
use crate::rollout::{Plant, Query, ReachAvoidTask, Region, Starts, Stream, Tightening};
use crate::scenario::Watch;
use crate::system::System;

/// Number of the stream of the starts.
const STREAM: u32 = 1 << 17;

/// Rolls out `count` starts drawn from the default box of the race.
pub(super) fn roll(
    backend: &Backend,
    network: &Mlp,
    seed: u64,
    count: u64,
    watch: &dyn Watch,
) -> Result<()> {
    let (system, spec) = (DroneRace::default(), data::rollout_spec()?);
    let axes = system.states();
    let low = axes.each_ref().map(|axis| axis.low);
    let region = Region::new_box(low, axes.each_ref().map(|axis| axis.high))?;
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream: Stream::new(seed, bench::PURPOSE, STREAM) },
        range: 0..count,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    backend.reach_avoid(Plant { system: &system, policy: network }, &task, &mut |_, measures| {
        black_box(measures);
        watch.advance(measures.len() as u64)
    })
}
