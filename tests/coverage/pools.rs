//! Pools of pairs of three plants, rolled out once in f64 and stored: certificates draw their samples from them
//! with replacement, so that the true risk of each is a count.

use std::sync::OnceLock;

use crate::common::race_policy;
use crate::plants::{BangBangSteering, Dubins, Duffing, Saturated};
use rand::RngExt;
use rand::rngs::StdRng;
use rayon::prelude::*;
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::rollout::drops::drops;
use reachcast::rollout::replay::{Margins, PairMargins, measure_of, pair_margins};
use reachcast::rollout::{
    PairControl, Pairs, Purpose, Region, RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::drops::shapes;
use reachcast::system::System;

/// Pairs of a pool.
pub(crate) const POOL: u64 = 20_000;
/// Pairs that fix the shapes of a pool.
const PILOT: u64 = 300;
/// Steps after which another task is decided.
const DEADLINE: usize = 1;

/// What a pair came to.
#[derive(Clone, Copy)]
pub(crate) struct Member {
    /// Largest drop.
    pub(crate) z: f64,
    /// Largest drop up to the deadline of another task, [`DEADLINE`].
    pub(crate) z_of_another: f64,
    pub(crate) score: f64,
    pub(crate) failed: bool,
}

pub(crate) struct Pool(pub(crate) Vec<Member>);

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
                z_of_another: shapes.largest(&until_deadline(&pair)),
                score: shapes.score(&pair.nominal),
                failed: measure_of(&pair.perturbed, &spec, &plain) <= 0.0,
            }
        };
        Self((0..POOL).into_par_iter().map(member).collect())
    }

    /// Share of the pairs that `holds` says.
    pub(crate) fn share(&self, holds: impl Fn(&Member) -> bool) -> f64 {
        self.0.iter().filter(|member| holds(member)).count() as f64 / self.0.len() as f64
    }

    /// Share of failures among the pairs with a score above `level`.
    pub(crate) fn conditional(&self, level: f64) -> f64 {
        let inside = self.share(|member| member.score > level);
        self.share(|member| member.score > level && member.failed) / inside
    }

    /// The level above which `share` of the scores lie.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let mut scores: Vec<f64> = self.0.iter().map(|member| member.score).collect();
        scores.sort_unstable_by(|a, b| b.total_cmp(a));
        scores[(share * scores.len() as f64) as usize]
    }

    pub(crate) fn draw(&self, random: &mut StdRng) -> Member {
        self.0[random.random_range(0..self.0.len())]
    }
}

/// A pair as far as a task looks at it whose target is to be reached by [`DEADLINE`].
fn until_deadline(pair: &PairMargins) -> PairMargins {
    let first = |margins: &[Margins]| margins[..=DEADLINE].to_vec();
    PairMargins { nominal: first(&pair.nominal), perturbed: first(&pair.perturbed) }
}

fn boxed<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> [Vec<f32>; 2] {
    let axes = system.states();
    [axes.iter().map(|axis| axis.low).collect(), axes.iter().map(|axis| axis.high).collect()]
}

/// The pools of three plants.
pub(crate) fn pools() -> &'static [(&'static str, Pool)] {
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
                pool(
                    &Plant::of(Dubins, BangBangSteering),
                    boxed(&Dubins),
                    0.1,
                    PairControl::ClosedLoop,
                ),
            ),
        ]
    })
}
