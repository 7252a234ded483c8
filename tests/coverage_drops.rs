//! Certificates by margin drops repeated over thousands of samples: the share of false ones is at most
//! beta.
//!
//! Pairs are rolled out once in f64 and kept as a pool; every certificate draws its sample from the pool
//! with replacement, so that its true risk is a count over the pool. The number of false certificates
//! among [`CERTIFICATES`] is compared with the exact binomial quantile, and each rule is shown to matter:
//! with the rule broken, the same harness reports a violation.

mod common;

use std::sync::OnceLock;

use common::{binomial_limit, race_policy};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::drops::drops;
use reachcast::rollout::replay::{PairMargins, measure_of, pair_margins};
use reachcast::rollout::{
    PairControl, Pairs, Purpose, Region, RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::bound::required_with_failures;
use reachcast::scenario::drops::{level, shapes};
use reachcast::scenario::drops_record::SequenceOutcome;
use reachcast::scenario::sequence::{Counts, Failed, Levels, test};
use reachcast::system::{Axis, System};

/// Repetitions of each certificate.
const CERTIFICATES: u64 = 2000;
/// Risk that the certificates claim.
const EPSILON: f64 = 0.1;
/// Chance that each may be false.
const BETA: f64 = 0.05;
/// Pairs of a pool.
const POOL: u64 = 20_000;
/// Pairs that fix the shapes of a pool.
const PILOT: u64 = 300;
/// Draws of a conditional sample.
const DRAWS: usize = 6000;

/// A unit mass in two wells, pushed towards the right one by a controller that saturates.
#[derive(Clone, Copy)]
struct Duffing;

impl System<2, 1> for Duffing {
    fn name(&self) -> &str {
        "duffing"
    }
    fn states(&self) -> [Axis; 2] {
        [Axis::new("x", "m", -1.8, 1.8), Axis::new("v", "m/s", -1.2, 1.2)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m/s^2", -0.4, 0.4)]
    }
    fn step<R: Real>(&self, [x, v]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        let dt = R::lit(0.1);
        let force = x - x * x * x - R::lit(0.3) * v + u;
        let v = v + dt * force;
        [x + dt * v, v]
    }
    fn target<R: Real>(&self, [x, v]: [R; 2]) -> R {
        let (x, half) = (x - R::lit(1.0), R::lit(0.5));
        R::lit(0.35) - x.abs().max(half * v.abs())
    }
    fn constraint<R: Real>(&self, [x, v]: [R; 2]) -> R {
        (R::lit(1.7) - x.abs()).min(R::lit(1.3) - v.abs())
    }
}

/// Twice the distance from the right well, at most 0.4.
struct Saturated;

impl Policy<2, 1> for Saturated {
    fn name(&self) -> String {
        "saturated".to_owned()
    }
    fn control<R: Real>(&self, [x, v]: [R; 2]) -> [R; 1] {
        let wanted = R::lit(2.0) * (R::lit(1.0) - x) - v;
        [wanted.clamp(R::lit(-0.4), R::lit(0.4))]
    }
}

/// A car of constant speed around a disc in its way.
#[derive(Clone, Copy)]
struct Dubins;

impl System<3, 1> for Dubins {
    fn name(&self) -> &str {
        "dubins"
    }
    fn states(&self) -> [Axis; 3] {
        [
            Axis::new("x", "m", -2.0, 0.0),
            Axis::new("y", "m", -1.0, 1.0),
            Axis::new("heading", "rad", -1.0, 1.0),
        ]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("turn", "rad/s", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x, y, heading]: [R; 3], [turn]: [R; 1]) -> [R; 3] {
        let dt = R::lit(0.1);
        let (sin, cos) = (heading.sin(), heading.cos());
        [x + dt * cos, y + dt * sin, heading + dt * turn]
    }
    fn target<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        let x = x - R::lit(1.5);
        R::lit(0.6) - (x * x + y * y).sqrt()
    }
    fn constraint<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        let y = y - R::lit(0.1);
        (x * x + y * y).sqrt() - R::lit(0.35)
    }
}

/// Full steering towards the target.
struct BangBang;

impl Policy<3, 1> for BangBang {
    fn name(&self) -> String {
        "bang-bang".to_owned()
    }
    fn control<R: Real>(&self, [x, y, heading]: [R; 3]) -> [R; 1] {
        let (sin, cos) = (heading.sin(), heading.cos());
        let across = cos * (R::lit(0.0) - y) - sin * (R::lit(1.5) - x);
        [R::lit(0.0).select_lt(across, R::lit(1.0), R::lit(-1.0))]
    }
}

/// What a pair came to.
#[derive(Clone, Copy)]
struct Member {
    /// Largest drop.
    z: f64,
    score: f64,
    failed: bool,
}

struct Pool(Vec<Member>);

impl Pool {
    /// Pairs of a plant, with shapes fixed by others.
    fn of(plant: &Plant, [low, high]: [Vec<f32>; 2], radius: f32, control: PairControl) -> Self {
        let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
        let region = Region::new_box(low, high).expect("a box");
        let margins = |number: u32, index: u64| -> PairMargins {
            let pairs = Pairs {
                nominal: Starts::Drawn {
                    region: region.clone(),
                    stream: Stream::new(5, Purpose::USER, number),
                },
                radius,
                stream: Stream::new(5, Purpose::USER, number + 1),
            };
            let [nominal, perturbed] = pairs.pair(index);
            pair_margins(plant, [&nominal, &perturbed], &spec, control)
        };
        let pilot = |index| drops(&margins(10, index)).collect::<Vec<_>>();
        let pilot: Vec<_> = (0..PILOT).into_par_iter().map(pilot).collect();
        let shapes = shapes(&pilot, 31);
        let plain = Tightening::none(&spec);
        let member = |index| {
            let pair = margins(20, index);
            Member {
                z: shapes.largest(&pair),
                score: shapes.score(&pair.nominal),
                failed: measure_of(&pair.perturbed, &spec, &plain) <= 0.0,
            }
        };
        Self((0..POOL).into_par_iter().map(member).collect())
    }

    /// Share of the pairs that `holds` says.
    fn share(&self, holds: impl Fn(&Member) -> bool) -> f64 {
        self.0.iter().filter(|member| holds(member)).count() as f64 / self.0.len() as f64
    }

    /// Share of failures among the pairs with a score above `level`.
    fn conditional(&self, level: f64) -> f64 {
        let inside = self.share(|member| member.score > level);
        self.share(|member| member.score > level && member.failed) / inside
    }

    fn draw(&self, random: &mut StdRng) -> Member {
        self.0[random.random_range(0..self.0.len())]
    }
}

fn boxed<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> [Vec<f32>; 2] {
    let axes = system.states();
    [axes.iter().map(|axis| axis.low).collect(), axes.iter().map(|axis| axis.high).collect()]
}

/// The pools of three plants.
fn pools() -> &'static [(&'static str, Pool)] {
    static POOLS: OnceLock<Vec<(&str, Pool)>> = OnceLock::new();
    POOLS.get_or_init(|| {
        let race = DroneRace::default();
        let pool =
            |plant: &Plant, region, radius, control| Pool::of(plant, region, radius, control);
        vec![
            ("race", pool(&Plant::of(race, race_policy()), boxed(&race), 0.1, PairControl::Replay)),
            (
                "duffing",
                pool(&Plant::of(Duffing, Saturated), boxed(&Duffing), 0.1, PairControl::ClosedLoop),
            ),
            (
                "dubins",
                pool(&Plant::of(Dubins, BangBang), boxed(&Dubins), 0.1, PairControl::ClosedLoop),
            ),
        ]
    })
}

/// How many of the certificates are false; each has a generator of its own.
fn false_ones(is_false: impl Fn(&mut StdRng) -> bool + Sync) -> u64 {
    let one = |seed| is_false(&mut StdRng::seed_from_u64(seed));
    (0..CERTIFICATES).into_par_iter().filter(|seed| one(*seed)).count() as u64
}

/// Whether `count` false certificates are more than a chance of [`BETA`] each explains.
fn violates(name: &str, count: u64) -> bool {
    let limit = binomial_limit(CERTIFICATES, BETA);
    println!("{name}: {count} of {CERTIFICATES} false, limit {limit}");
    count > limit
}

#[test]
fn bounds_on_drops_hold_with_and_without_discards() {
    for (name, pool) in pools() {
        for discards in [0, 7] {
            let need = required_with_failures(EPSILON, BETA, discards).expect("a count");
            let count = |pairs: u64| {
                false_ones(|random| {
                    let sample = (0..pairs).map(|_| pool.draw(random).z);
                    let level = level(sample, discards);
                    pool.share(|member| member.z > level) > EPSILON
                })
            };
            let name = format!("drops of {name}, {discards} discarded");
            assert!(!violates(&name, count(need)));
            assert!(violates(&format!("{name}, from half the pairs"), count(need / 2)));
        }
    }
}

#[test]
fn calibrations_hold_with_and_without_discards() {
    for (name, pool) in pools() {
        let failing = pool.share(|member| member.failed);
        assert!(failing > 1.5 * EPSILON, "{name}: {failing} fail, every level holds");
        for discards in [0, 7] {
            let need = required_with_failures(EPSILON, BETA, discards).expect("a count");
            let count = |pairs: u64| {
                false_ones(|random| {
                    let sample = (0..pairs).map(|_| pool.draw(random));
                    let of = |one: Member| if one.failed { one.score } else { f64::NEG_INFINITY };
                    let level = level(sample.map(of), discards);
                    pool.share(|member| member.score > level && member.failed) > EPSILON
                })
            };
            let name = format!("calibration of {name}, {discards} discarded");
            assert!(!violates(&name, count(need)));
        }
    }
}

/// How a sequence is gone through.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// As it has to be.
    Sound,
    /// It goes on after a refusal, to the laxest level whose bound is low enough.
    GoesOn,
    /// Levels are the scores of the very sample that tests them.
    LevelsOfTheSample,
}

/// Whether a sequence for the risk `risk` claims a set whose risk is above.
fn sequence_is_false(
    pool: &Pool,
    risk: f64,
    needed: &[u64],
    rule: Rule,
    random: &mut StdRng,
) -> bool {
    let sample: Vec<Member> = (0..DRAWS).map(|_| pool.draw(random)).collect();
    let pilot: Vec<f64> = (0..2048).map(|_| pool.draw(random).score).collect();
    let mut levels = Levels::new(pilot, DRAWS as u64, Some(risk), BETA, 0.0);
    assert!(levels.tested, "draws enough");
    if rule == Rule::LevelsOfTheSample {
        levels.levels = sample.iter().map(|one| one.score).filter(|score| *score > 0.0).collect();
        levels.levels.sort_unstable_by(|a, b| b.total_cmp(a));
        levels.levels.drain(..(levels.start.expect("a start") as usize) / 3);
    }
    let counts = |all: &[f64]| {
        let mut counts = Counts::new(all.len());
        for one in &sample {
            let first = all.partition_point(|level| *level >= one.score);
            counts.add(first, if one.failed { Failed::Yes } else { Failed::No });
        }
        counts
    };
    if rule == Rule::Sound {
        let found = test(&levels, &counts(&levels.levels), Some(risk), BETA, 0).expect("a test");
        let level = found.level().expect("a level");
        return found.outcome == SequenceOutcome::Accepted && pool.conditional(level) > risk;
    }
    let mut sorted = sample.clone();
    sorted.sort_unstable_by(|a, b| b.score.total_cmp(&a.score));
    let failures: Vec<usize> = std::iter::once(0)
        .chain(sorted.iter().scan(0, |failures, one| {
            *failures += usize::from(one.failed);
            Some(*failures)
        }))
        .collect();
    let accepted = |level: &&f64| {
        let inside = sorted.partition_point(|one| one.score > **level);
        needed.get(failures[inside]).is_some_and(|needed| inside as u64 >= *needed)
    };
    let last = levels.levels.iter().rev().find(accepted);
    last.is_some_and(|level| pool.conditional(*level) > risk)
}

/// Draws that support the risk `risk`, by the failures among them.
fn needed(risk: f64) -> Vec<u64> {
    let needed = |failures| required_with_failures(risk, BETA, failures).expect("a count");
    (0..).map(needed).take_while(|needed| *needed <= DRAWS as u64).collect()
}

/// The level above which `share` of the pool's scores lie.
fn quantile(pool: &Pool, share: f64) -> f64 {
    let mut scores: Vec<f64> = pool.0.iter().map(|member| member.score).collect();
    scores.sort_unstable_by(|a, b| b.total_cmp(a));
    scores[(share * scores.len() as f64) as usize]
}

#[test]
fn sequences_hold_also_where_the_risk_is_just_above() {
    for (name, pool) in pools() {
        let positive = pool.share(|member| member.score > 0.0);
        // Just below the true risk of the middle of the sequence, and of its first set.
        for share in [0.8, 0.55] {
            let risk = pool.conditional(quantile(pool, share * positive)) * 0.98;
            if 3.0 * BETA.ln() / (-risk).ln_1p() > 0.9 * positive * DRAWS as f64 {
                println!("{name} at {share}: the risk {risk} takes more draws than there are");
                continue;
            }
            let count =
                false_ones(|random| sequence_is_false(pool, risk, &[], Rule::Sound, random));
            assert!(!violates(&format!("sequence of {name} at the risk {risk:.4}"), count));
        }
    }
}

/// Scores that say nothing of failures: every set has a risk just above the one asked for.
fn flat() -> Pool {
    let risk = 0.0204;
    let member = |i: u64| Member {
        z: 0.0,
        score: (i * 7919 % POOL) as f64 / POOL as f64,
        failed: (i as f64 * risk).fract() + risk >= 1.0,
    };
    Pool((0..POOL).map(member).collect())
}

#[test]
fn a_sequence_that_goes_on_or_looks_at_its_sample_is_caught() {
    let pool = flat();
    assert!((pool.conditional(0.0) - 0.0204).abs() < 2e-4);
    let needed = needed(0.02);
    let count = |rule| false_ones(|random| sequence_is_false(&pool, 0.02, &needed, rule, random));
    assert!(!violates("sequence", count(Rule::Sound)));
    assert!(violates("sequence that goes on after a refusal", count(Rule::GoesOn)));
}

#[test]
fn levels_of_the_sample_are_caught() {
    let pool = flat();
    let needed = needed(0.02);
    let count = |rule| false_ones(|random| sequence_is_false(&pool, 0.02, &needed, rule, random));
    assert!(violates("levels chosen on the test sample", count(Rule::LevelsOfTheSample)));
}

/// Half of the nominal starts fail at once, as do their perturbed ones; the others are better off when
/// perturbed. A level below 0 would certify starts that fail themselves.
#[test]
fn levels_are_never_below_zero() {
    let member = |i: u64| match i % 2 {
        0 => Member { z: f64::NEG_INFINITY, score: -0.1, failed: true },
        _ => Member { z: -0.5, score: 1.0, failed: false },
    };
    let pool = Pool((0..POOL).map(member).collect());
    let need = required_with_failures(EPSILON, BETA, 0).expect("a count");
    let count = |of: &(dyn Fn(Vec<f64>) -> f64 + Sync)| {
        false_ones(|random| {
            let level = of((0..need).map(|_| pool.draw(random).z).collect());
            pool.share(|member| member.score > level && member.failed) > EPSILON
        })
    };
    assert!(!violates("levels", count(&|sizes| level(sizes.into_iter(), 0))));
    let open = |sizes: Vec<f64>| sizes.into_iter().fold(f64::NEG_INFINITY, f64::max);
    assert!(violates("levels below 0 let through", count(&open)));
}
