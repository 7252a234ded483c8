//! Tallies of starts and of pairs on every backend: cut anywhere, merged in any order to the same bits.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ops::Range;

use crate::common::{backends, cpu, race_policy};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::Result;
use reachcast::backend::Program;
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::rollout::{
    DeviationTask, Farthest, Keep, MeasureCounts, MeasureTally, NON_FINITE, PairControl,
    PairMeasure, PairTally, Pairs, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts,
    Stream, Tightening,
};
use reachcast::system::{BangBang, DoubleIntegrator};

/// More starts than a piece of a batch has, and no round number of them.
const RANGE: Range<u64> = 1_070..2_201;
const PARTS: usize = 7;

/// A formula, and a network.
fn plants() -> [Plant; 2] {
    let policy = BangBang { acceleration: 1.0 };
    [Plant::of(DoubleIntegrator::default(), policy), Plant::of(DroneRace::default(), race_policy())]
}

fn spec() -> RolloutSpec {
    RolloutSpec::new(20, 0.95).unwrap()
}

/// Starts drawn from the plant's own box.
fn starts(plant: &Plant) -> Starts<'static> {
    let corner = |of: fn(&reachcast::system::Axis) -> f32| -> Vec<f32> {
        plant.model.states.iter().map(of).collect()
    };
    let region = Region::new_box(corner(|axis| axis.low), corner(|axis| axis.high)).unwrap();
    Starts::Drawn { region, stream: Stream::new(3, Purpose::USER, 0) }
}

/// `RANGE` cut at random places, two of which may be the same.
fn cut(random: &mut StdRng) -> Vec<Range<u64>> {
    let mut places: Vec<u64> = (1..PARTS).map(|_| random.random_range(RANGE)).collect();
    places.extend([RANGE.start, RANGE.end]);
    places.sort_unstable();
    places.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

/// The parts merged two by two at random, so that merged ones meet merged ones.
fn merged<T>(mut parts: Vec<T>, random: &mut StdRng, merge: impl Fn(&mut T, T) -> Result<()>) -> T {
    while parts.len() > 1 {
        let one = parts.swap_remove(random.random_range(0..parts.len()));
        let other = random.random_range(0..parts.len());
        merge(&mut parts[other], one).unwrap();
    }
    parts.remove(0)
}

/// The measures of `tally` in bits, with its counts.
fn measures(tally: MeasureTally) -> (MeasureCounts, Vec<u32>) {
    let all = tally.finish(RANGE).unwrap();
    (all.counts, all.values.into_iter().map(f32::to_bits).collect())
}

/// What was sent to a sink, counted by itself.
fn counted(program: &Program<'_>, task: &ReachAvoidTask<'_>) -> (MeasureCounts, Vec<u32>) {
    let mut values = Vec::new();
    let sink = &mut |_: u64, piece: &[f32]| {
        values.extend_from_slice(piece);
        Ok(())
    };
    program.reach_avoid(task, sink).unwrap();
    let count = |holds: fn(&&f32) -> bool| values.iter().filter(holds).count() as u64;
    let extreme = |of: fn(f32, f32) -> f32| {
        let measure = values.iter().copied().reduce(of).unwrap();
        let place = values.iter().position(|value| *value == measure).unwrap();
        Some(reachcast::rollout::Extreme { measure, start: RANGE.start + place as u64 })
    };
    let counts = MeasureCounts {
        starts: values.len() as u64,
        successes: count(|value| **value > 0.0),
        non_finite: count(|value| **value == NON_FINITE),
        least: extreme(f32::min),
        greatest: extreme(f32::max),
    };
    (counts, values.into_iter().map(f32::to_bits).collect())
}

#[test]
fn starts_cut_anywhere_give_the_bits_of_the_whole() {
    let mut random = StdRng::seed_from_u64(1);
    for backend in backends() {
        for plant in plants() {
            let program = backend.prepare(&plant).unwrap();
            for query in [Query::Measure, Query::Sign] {
                let (starts, tightening) = (starts(&plant), &Tightening::none(&spec()));
                let task = |range| ReachAvoidTask {
                    starts: starts.clone(),
                    range,
                    spec: spec(),
                    tightening,
                    query,
                };
                let tally = |range, keep| program.tally(&task(range), keep).unwrap();
                let whole = measures(tally(RANGE, Keep::Measures));
                assert_eq!(whole, counted(&program, &task(RANGE)), "{} {query:?}", backend.name());
                assert!((1..whole.0.starts).contains(&whole.0.successes), "{:?}", whole.0);
                let parts: Vec<MeasureTally> = cut(&mut random)
                    .into_iter()
                    .map(|range| tally(range, Keep::Measures))
                    .collect();
                for _ in 0..5 {
                    let all = merged(parts.clone(), &mut random, MeasureTally::merge);
                    assert_eq!(all.ranges().collect::<Vec<_>>(), [RANGE]);
                    assert_eq!(measures(all), whole, "{} {query:?}", backend.name());
                }
                let counts = measures(tally(RANGE, Keep::Counts));
                assert_eq!(counts, (whole.0, Vec::new()), "values are kept where asked for");
            }
        }
    }
}

/// Farthest pairs and measures in bits.
#[derive(Debug, PartialEq)]
struct PairBits {
    farthest: Vec<(u32, u64)>,
    values: Vec<[u32; 2]>,
}

impl PairBits {
    fn of(farthest: &[Farthest], values: &[PairMeasure]) -> Self {
        let value = |pair: &PairMeasure| [pair.nominal.to_bits(), pair.perturbed.to_bits()];
        let far = |far: &Farthest| (far.distance.to_bits(), far.pair);
        Self {
            farthest: farthest.iter().map(far).collect(),
            values: values.iter().map(value).collect(),
        }
    }

    fn sent(program: &Program<'_>, task: &DeviationTask<'_>) -> Self {
        let mut values = Vec::new();
        let sink = &mut |_: u64, piece: &[PairMeasure]| {
            values.extend_from_slice(piece);
            Ok(())
        };
        let farthest = program.deviation(task, sink).unwrap();
        Self::of(&farthest, &values)
    }
}

#[test]
fn pairs_cut_anywhere_give_the_bits_of_the_whole() {
    let mut random = StdRng::seed_from_u64(2);
    for backend in backends() {
        for plant in plants() {
            let program = backend.prepare(&plant).unwrap();
            for control in [PairControl::Replay, PairControl::ClosedLoop] {
                let place = format!("{} {control:?}", backend.name());
                let stream = Stream::new(3, Purpose::USER, 1);
                let pairs = Pairs { nominal: starts(&plant), radius: 0.1, stream };
                let tightening = &Tightening::none(&spec());
                let task = |range| DeviationTask {
                    pairs: pairs.clone(),
                    range,
                    spec: spec(),
                    tightening,
                    control,
                };
                let tally = |range| program.tally_pairs(&task(range), Keep::Measures).unwrap();
                let whole = tally(RANGE).finish(RANGE).unwrap();
                let bits = PairBits::of(&whole.farthest, &whole.values);
                assert_eq!(bits, PairBits::sent(&program, &task(RANGE)), "{place}");
                let accepted = whole.values.iter().filter(|pair| pair.nominal > 0.0).count();
                assert_eq!(whole.counts.accepted, accepted as u64, "{place}");
                assert!(accepted > 0 && whole.farthest.iter().all(|far| far.distance > 0.0));
                let parts: Vec<PairTally> = cut(&mut random).into_iter().map(tally).collect();
                for _ in 0..5 {
                    let all = merged(parts.clone(), &mut random, PairTally::merge);
                    assert_eq!(all.ranges().collect::<Vec<_>>(), [RANGE]);
                    let all = all.finish(RANGE).unwrap();
                    assert_eq!(all.counts, whole.counts, "{place}");
                    assert_eq!(PairBits::of(&all.farthest, &all.values), bits, "{place}");
                }
                let few = program.tally_pairs(&task(RANGE), Keep::Counts).unwrap();
                assert_eq!((few.counts(), few.farthest()), (&whole.counts, &*whole.farthest));
                assert!(few.finish(RANGE).unwrap().values.is_empty(), "{place}");
            }
        }
    }
}

#[test]
fn parts_that_overlap_or_are_missing_are_named() {
    let [plant, _] = plants();
    let backend = cpu(1);
    let program = backend.prepare(&plant).unwrap();
    let none = Tightening::none(&spec());
    let part = |range| {
        let (starts, query) = (starts(&plant), Query::Sign);
        let task = ReachAvoidTask { starts, range, spec: spec(), tightening: &none, query };
        program.tally(&task, Keep::Counts).unwrap()
    };
    let mut tally = part(0..256);
    let before = *tally.counts();
    let refused = tally.merge(part(200..300)).unwrap_err().to_string();
    assert!(refused.contains("200..300") && refused.contains("0..256"), "{refused}");
    assert_eq!((*tally.counts(), tally.missing(0..256)), (before, None));
    tally.merge(part(300..700)).unwrap();
    assert_eq!(tally.missing(0..700), Some(256..300));
    let gap = tally.clone().finish(0..700).unwrap_err().to_string();
    assert!(gap.contains("starts 256..300 of 0..700 are missing"), "{gap}");
    tally.merge(part(256..300)).unwrap();
    assert_eq!(tally.finish(0..700).unwrap().counts.starts, 700);
}
