//! The functions of formulas over special numbers: plants whose measure is a function of the start.

use std::array::from_fn;

use reachcast::backend::Backend;
use reachcast::formula::{Function, record};
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::real::{Lanes, Real};
use reachcast::rollout::{NON_FINITE, Query, ReachAvoidTask, RolloutSpec, Starts, Tightening};
use reachcast::system::{Axis, System};

/// Margin that ends a rollout after its first state.
const FAR: f32 = 1.0e9;
/// Values beyond are held here, so that an infinite one is no failure of the rollout.
const MOST: f32 = 1.0e6;
/// What an adapter may be farther from f64 than the host's own f32.
const FACTOR: f64 = 8.0;

/// A function of a number that may be infinite or NaN, and of one that is finite.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Case {
    Of(Function),
    Sign,
    Floor,
    Smaller,
    SmallerBehind,
    Larger,
    LargerBehind,
    Held,
    HeldBelow,
    Less,
    LessBehind,
    NotMore,
    Equal,
    Length,
    Angle,
    AngleBehind,
    Whole(i32),
    Power(f32),
}

impl Case {
    /// Its value; of `a b`, or what `c` says that no state may be, and of `d`.
    pub(crate) fn eval<R: Real>(self, [a, b, c, d]: [R; 4]) -> R {
        let (zero, one) = (R::lit(0.0), R::lit(1.0));
        let odd = R::lit(1.5).if_lt(c, R::lit(f32::NAN), a * R::lit(f32::INFINITY));
        let x = R::lit(0.5).if_lt(c, odd, a * b);
        let value = match self {
            Self::Of(function) => function.apply(x),
            Self::Sign => x.sign(),
            Self::Floor => x.floor(),
            Self::Smaller => x.min(d),
            Self::SmallerBehind => d.min(x),
            Self::Larger => x.max(d),
            Self::LargerBehind => d.max(x),
            Self::Held => x.clamp(-one, d.abs()),
            Self::HeldBelow => d.clamp(-one, x),
            Self::Less => x.if_lt(d, one, zero),
            Self::LessBehind => d.if_lt(x, one, zero),
            Self::NotMore => x.if_le(d, one, zero),
            Self::Equal => x.if_eq(d, one, zero),
            Self::Length => x.hypot(d),
            Self::Angle => x.atan2(d),
            Self::AngleBehind => d.atan2(x),
            Self::Whole(exponent) => x.powi(exponent),
            Self::Power(exponent) => x.powf(exponent),
        };
        value.clamp(R::lit(-MOST), R::lit(MOST))
    }
}

/// A plant whose measure is the case at the start: the next state is far outside the target.
struct Probe(Case);

impl System<5, 1> for Probe {
    fn name(&self) -> &str {
        "probe"
    }
    fn states(&self) -> [Axis; 5] {
        from_fn(|i| Axis::new(&format!("x{i}"), "", -2.0, 2.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [a, b, c, d, _]: [R; 5], [u]: [R; 1]) -> [R; 5] {
        [a, b, c, d, u]
    }
    fn target<R: Real>(&self, [a, b, c, d, seen]: [R; 5]) -> R {
        R::lit(0.5).if_lt(seen, R::lit(-FAR), self.0.eval([a, b, c, d]))
    }
    fn constraint<R: Real>(&self, _: [R; 5]) -> R {
        R::lit(FAR)
    }
}

/// The control that marks the second state.
struct Mark;

impl Policy<5, 1> for Mark {
    fn name(&self) -> String {
        "mark".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 5]) -> [R; 1] {
        [R::lit(1.0)]
    }
}

/// Starts: finite numbers, both infinities and NaN, each beside finite numbers.
fn starts() -> Vec<[f32; 5]> {
    const FINITE: [f32; 18] = [
        0.0, -0.0, 1e-6, 0.3, -0.5, 0.75, 1.0, -1.0, 1.25, -1.25, 2.0, 2.5, -3.0, 7.0, -20.0, 60.0,
        80.0, -90.0,
    ];
    let odd = [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 2.0]];
    let all = FINITE.map(|x| [x, 1.0, 0.0]).into_iter().chain(odd);
    let beside = [0.0, 1.0, -1.0, 0.4, -3.0, 60.0];
    all.flat_map(|[a, b, c]| beside.map(|d| [a, b, c, d, 0.0])).collect()
}

/// Equal, or both NaN.
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// What `backend` computes, and whether lanes, the graph and its expansion have the bits of f32.
///
/// # Errors
/// The first number that differs from f64 by more than a multiple of what f32 does, or where a NaN is
/// lost or made.
pub(crate) fn disagreement(backend: &Backend, case: Case) -> Result<(), String> {
    let starts = starts();
    let host: Vec<f32> = starts.iter().map(|[x @ .., _]| case.eval(*x)).collect();
    let graph = record(4, |x| vec![case.eval(from_fn(|i| x[i]))]);
    let expanded = graph.expanded();
    for ([x @ .., _], host) in starts.iter().zip(&host) {
        let lanes = case.eval(x.map(|x| Lanes([x; 4]))).0[3];
        for found in [lanes, graph.eval(x)[0], expanded.eval(x)[0]] {
            if !same(found, *host) {
                return Err(format!("{case:?} of {x:?}: {found}, f32 has {host}"));
            }
        }
    }
    let distance = |value: f32, truth: f64| (f64::from(value) - truth).abs() / (1.0 + truth.abs());
    let truth: Vec<f64> = starts.iter().map(|[x @ .., _]| case.eval(x.map(f64::from))).collect();
    let numbers = || host.iter().zip(&truth).filter(|(host, _)| !host.is_nan());
    let worst = numbers().map(|(host, truth)| distance(*host, *truth)).fold(0.0, f64::max);
    let band = FACTOR * worst + 1e-6;
    for (i, value) in measures(backend, case, &starts)?.into_iter().enumerate() {
        let agrees = match host[i].is_nan() {
            true => truth[i].is_nan() && value == NON_FINITE,
            false => distance(value, truth[i]) <= band,
        };
        if !agrees {
            let (start, truth) = (starts[i], truth[i]);
            return Err(format!("{case:?} of {start:?}: {value}, f64 has {truth}, band {band:e}"));
        }
    }
    Ok(())
}

/// The measures of the starts.
fn measures(backend: &Backend, case: Case, starts: &[[f32; 5]]) -> Result<Vec<f32>, String> {
    let spec = RolloutSpec::new(1, 1.0).expect("spec");
    let task = ReachAvoidTask {
        starts: Starts::listed(starts),
        range: 0..starts.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let mut measures = Vec::new();
    let sink = &mut |_: u64, values: &[f32]| {
        measures.extend_from_slice(values);
        Ok(())
    };
    let prepared = backend.prepare(&Plant::of(Probe(case), Mark));
    let ran = prepared.and_then(|program| program.reach_avoid(&task, sink));
    ran.map_err(|error| error.to_string())?;
    Ok(measures)
}
