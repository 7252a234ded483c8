//! Margins that are infinite or no number: satisfied, violated, failed.

use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, HUGE, NON_FINITE, PairControl, Pairs, Purpose, Query, ReachAvoidTask,
    RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::system::{Axis, System};

use crate::common::cpu;
use crate::systems::Idle;
use crate::{each_way, ramp, random_network};

/// What a margin is from the fourth state on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Late {
    /// What it was.
    Same,
    /// Infinite.
    Infinite,
    /// Minus infinity.
    MinusInfinite,
    /// No number.
    NotANumber,
}

impl Late {
    /// `early` while `n` is at most 3.
    fn after<R: Real>(self, n: R, early: R) -> R {
        // No compiler knows that this is 1e30: infinities come of numbers, not of literals.
        let large = R::lit(1.0e30) + R::lit(0.0) * n;
        let infinite = large * large;
        let late = match self {
            Self::Same => early,
            Self::Infinite => infinite,
            Self::MinusInfinite => -infinite,
            #[expect(clippy::eq_op, reason = "infinity less infinity is what makes a NaN")]
            Self::NotANumber => infinite - infinite,
        };
        R::lit(3.0).if_lt(n, late, early)
    }
}

/// Counts its steps in the first state: the target margin is that less 10, the constraint margin 2.
#[derive(Clone)]
struct Walls {
    target: Late,
    constraint: Late,
}

impl System<2, 1> for Walls {
    fn name(&self) -> &str {
        "walls"
    }
    fn states(&self) -> [Axis; 2] {
        ["n", "x"].map(|name| Axis::new(name, "", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [n, x]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [n + R::lit(1.0) + R::lit(0.0) * u, x]
    }
    fn target<R: Real>(&self, [n, _]: [R; 2]) -> R {
        self.target.after(n, n - R::lit(10.0))
    }
    fn constraint<R: Real>(&self, [n, _]: [R; 2]) -> R {
        self.constraint.after(n, R::lit(2.0))
    }
}

/// Measures and signs over states 0 to 6 of the count from 0, and of the count from -3.
fn found(backend: &Backend, plant: &Plant, query: Query) -> Vec<f32> {
    let spec = RolloutSpec::new(6, 1.0).expect("a horizon");
    let starts = [[0.0, 0.5], [-3.0, 0.5]];
    let task = ReachAvoidTask {
        starts: Starts::listed(&starts),
        range: 0..2,
        spec,
        tightening: &Tightening::none(&spec),
        query,
    };
    let mut all = Vec::new();
    let program = backend.prepare(plant).expect("it fits");
    let ran = program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("it runs");
    all
}

/// The cases and their measures, the count from 0 and from -3: the last state of the second is 3, so
/// that nothing is late.
const CASES: [(Late, Late, [f32; 2]); 8] = [
    (Late::Same, Late::Same, [-4.0, -7.0]),
    // Without walls.
    (Late::Same, Late::Infinite, [-4.0, -7.0]),
    // The target is everywhere: what counts is the constraint.
    (Late::Infinite, Late::Same, [2.0, -7.0]),
    (Late::Infinite, Late::Infinite, [2.0, -7.0]),
    // Violated for good; what came before stands, and it is no failure to be counted.
    (Late::Same, Late::MinusInfinite, [-7.0, -7.0]),
    (Late::MinusInfinite, Late::Same, [-7.0, -7.0]),
    (Late::NotANumber, Late::Same, [NON_FINITE, -7.0]),
    (Late::Infinite, Late::NotANumber, [NON_FINITE, -7.0]),
];

#[test]
fn infinite_margins_are_satisfied_or_violated_and_others_fail() {
    each_way(|gpu| {
        let (device, host) = (Backend::Gpu(gpu), cpu(1));
        let network = random_network(&[2, 4, 1], Activation::Tanh);
        for (target, constraint, measures) in CASES {
            let walls = Walls { target, constraint };
            let (idle, driven) =
                (Plant::of(walls.clone(), Idle), Plant::of(walls, network.clone()));
            let sign = |g: f32| if g == NON_FINITE { g } else { g.signum() };
            for (query, expected) in [(Query::Measure, measures), (Query::Sign, measures.map(sign))]
            {
                let case = format!("{target:?}, {constraint:?}, {query:?}");
                assert_eq!(found(&device, &idle, query), expected, "{case}");
                assert_eq!(found(&device, &driven, query), expected, "{case}, network");
                assert_eq!(found(&host, &idle, query), expected, "{case} on the CPU");
            }
        }
    });
}

/// Infinite from the start on: the measure is the largest there is, and finite.
#[test]
fn a_measure_stays_finite() {
    each_way(|gpu| {
        let (device, host) = (Backend::Gpu(gpu), cpu(1));
        let walls = Walls { target: Late::Infinite, constraint: Late::Infinite };
        let plant = Plant::of(walls, Idle);
        let spec = RolloutSpec::new(6, 0.5).expect("a horizon");
        let starts = [[4.0, 0.5]];
        let task = DeviationTask {
            pairs: Pairs {
                nominal: Starts::listed(&starts),
                radius: 0.0,
                stream: Stream::new(1, Purpose::USER, 0),
            },
            range: 0..1,
            spec,
            tightening: &ramp(&spec),
            control: PairControl::Replay,
        };
        for backend in [&device, &host] {
            let mut all = Vec::new();
            let program = backend.prepare(&plant).expect("it fits");
            let ran = program.deviation(&task, &mut |_, pairs| {
                all.extend(pairs.iter().flat_map(|pair| [pair.nominal, pair.perturbed]));
                Ok(())
            });
            ran.expect("it runs");
            assert_eq!(all, [HUGE; 2], "{}", backend.name());
        }
    });
}
