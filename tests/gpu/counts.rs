//! Counts and extremes that the device finds itself: those of the host's tally of the same measures, to
//! the bit, in any chunks.

use reachcast::backend::gpu::{Gpu, Injection};
use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, Extreme, Keep, MeasureCounts, NON_FINITE, PairControl, PairCounts, Pairs, Query,
    ReachAvoidTask, RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::purpose;
use reachcast::system::{Axis, System};
use reachcast::{Fault, Result};

use crate::systems::Idle;
use crate::{drawn, each_way, gpu, ramp, random_network, whole_box};

/// Stays where it is: the measure is the state, and what is no number fails.
#[derive(Clone)]
pub(crate) struct Still;

impl System<1, 1> for Still {
    fn name(&self) -> &str {
        "still"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [x + R::lit(0.0) * u]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [_]: [R; 1]) -> R {
        R::lit(1.0e9)
    }
}

/// More starts than a workgroup counts, and no round number of them.
const STARTS: usize = 9_001;

/// Zeros of both signs, the smallest numbers, large ones, and what is not finite, over and over.
fn list() -> Vec<[f32; 1]> {
    let few = [
        0.0,
        -0.0,
        1.5,
        -2.5,
        f32::NAN,
        f32::MIN_POSITIVE,
        -f32::MIN_POSITIVE,
        1e8,
        f32::INFINITY,
        -1e29,
        f32::NEG_INFINITY,
    ];
    // 11 and 7 share no factor: no two workgroups begin alike.
    (0..STARTS).map(|i| [few[i * 7 % few.len()]]).collect()
}

fn task<'a>(
    starts: &Starts<'a>,
    tightening: &'a Tightening,
    spec: RolloutSpec,
    query: Query,
) -> ReachAvoidTask<'a> {
    ReachAvoidTask { starts: starts.clone(), range: 0..STARTS as u64, spec, tightening, query }
}

/// Counts in bits.
fn bits(counts: &MeasureCounts) -> ([u64; 3], [Option<(u32, u64)>; 2]) {
    let of = |extreme: Option<Extreme>| extreme.map(|of| (of.measure.to_bits(), of.start));
    let MeasureCounts { starts, successes, non_finite, least, greatest } = *counts;
    ([starts, successes, non_finite], [of(least), of(greatest)])
}

/// What the device counts, and what the host counts of the device's measures.
fn both(program: &Program<'_>, task: &ReachAvoidTask<'_>) -> [MeasureCounts; 2] {
    [Keep::Counts, Keep::Measures].map(|keep| *program.tally(task, keep).expect("it runs").counts())
}

/// Failures that halve the chunks, down to the smallest.
pub(crate) fn halved(gpu: Gpu, times: u64) -> Gpu {
    let once = |submission| Injection { fault: Fault::OutOfMemory, submission, repeats: false };
    gpu.with_failures((0..times).map(once).collect())
}

#[test]
fn the_device_counts_what_the_host_counts() {
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let (list, tightening) = (list(), Tightening::none(&spec));
    let starts = Starts::listed(&list);
    let mut found = Vec::new();
    for halvings in [0, 1, 5] {
        let Some(gpu) = gpu() else { return };
        let backend = Backend::Gpu(halved(gpu, halvings));
        let program = backend.prepare(&Plant::of(Still, Idle)).expect("it fits");
        for query in [Query::Measure, Query::Sign] {
            let [device, host] = both(&program, &task(&starts, &tightening, spec, query));
            assert_eq!(bits(&device), bits(&host), "{query:?} after {halvings} halvings");
            found.push((query, bits(&device)));
        }
    }
    // 11 kinds of starts: 4 are positive, 3 are no finite state.
    let ([starts, successes, non_finite], [least, _]) = found[0].1;
    assert_eq!(starts, STARTS as u64);
    assert!((3 * starts / 11..=5 * starts / 11).contains(&successes), "{successes}");
    assert!((3 * starts / 11 - 1..=4 * starts / 11).contains(&non_finite), "{non_finite}");
    assert_eq!(least.map(|(bits, _)| bits), Some(NON_FINITE.to_bits()));
    for query in [Query::Measure, Query::Sign] {
        let mut of = found.iter().filter(|(of, _)| *of == query).map(|(_, bits)| bits);
        let first = of.next().expect("it was asked");
        assert!(of.all(|other| other == first), "in any chunks: {found:?}");
    }
}

/// How the pairs of the race fared, on the device and on the host.
fn pairs(gpu: Gpu, control: PairControl) -> [(PairCounts, Vec<(u32, u64)>); 2] {
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 16, 3], Activation::Relu));
    let spec = RolloutSpec::new(9, 0.95).expect("a horizon");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: drawn(whole_box(&system), 71),
            radius: 0.2,
            stream: Stream::new(72, purpose::DEVIATION_PERTURBATION, 0),
        },
        range: 3..4_500,
        spec,
        tightening: &ramp(&spec),
        control,
    };
    let backend = Backend::Gpu(gpu);
    let program = backend.prepare(&plant).expect("it fits");
    [Keep::Counts, Keep::Measures].map(|keep| {
        let tally = program.tally_pairs(&task, keep).expect("it runs");
        let far = tally.farthest().iter().map(|far| (far.distance.to_bits(), far.pair));
        (*tally.counts(), far.collect())
    })
}

#[test]
fn pairs_are_counted_as_on_the_host() {
    each_way(|gpu| {
        let [device, host] = pairs(gpu, PairControl::ClosedLoop);
        assert_eq!(device, host);
        assert_eq!(device.0.pairs, 4_497);
        assert!(device.0.accepted > 0 && device.0.reached > 0, "{:?}", device.0);
    });
    let Some(gpu) = gpu() else { return };
    let [device, host] = pairs(halved(gpu, 4), PairControl::Replay);
    assert_eq!(device, host, "in small chunks");
}

/// Counts under a changed kernel.
fn changed(from: &'static str, to: &'static str) -> Option<Result<[MeasureCounts; 2]>> {
    let gpu = gpu()?.with_shader_edit(move |text| {
        assert!(!text.contains("fn count(") || text.contains(from), "no `{from}`");
        text.replace(from, to)
    });
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let (list, tightening) = (list(), Tightening::none(&spec));
    let starts = Starts::listed(&list);
    let backend = Backend::Gpu(gpu);
    let program = backend.prepare(&Plant::of(Still, Idle)).expect("it fits");
    Some(Ok(both(&program, &task(&starts, &tightening, spec, Query::Measure))))
}

/// The comparison above sees each of these.
#[test]
fn a_count_that_is_changed_is_seen() {
    for (from, to) in [
        // Zeros succeed.
        ("u32(at > ZERO)", "u32(at >= ZERO)"),
        // What failed is finite.
        ("u32(at <= lost)", "u32(at < lost)"),
        // Of equal ones the last.
        ("b.x < a.x || (b.x == a.x && b.y < a.y)", "b.x < a.x || (b.x == a.x && b.y > a.y)"),
        // A workgroup leaves out its last column.
        (
            "(group.x + 1u) * COUNTED, params.columns)",
            "(group.x + 1u) * COUNTED - 1u, params.columns)",
        ),
        // Signs are no part of the order.
        ("select(bits | SIGN, ~bits, (bits & SIGN) != 0u)", "bits | SIGN"),
    ] {
        let Some(counts) = changed(from, to) else { return };
        let [device, host] = counts.expect("it runs");
        assert_ne!(bits(&device), bits(&host), "`{to}` is not seen");
    }
}
