//! MPPI in f64, one sample after the other, and how far an adapter may lie from it.

use std::array::from_fn;

use nalgebra::DMatrix;
use reachcast::cost::{Cost, CostMap, Lookup};
use reachcast::rollout::{MppiProblem, MppiResult, MppiSettings, Planning, Sigma};
use reachcast::system::System;

/// What a problem gives in f64; controls are those of [`Planning::controls`], in f32.
pub(crate) struct Truth {
    pub(crate) costs: Vec<f64>,
    /// `[H, controls]`.
    pub(crate) plan: Vec<f64>,
    pub(crate) effective_samples: f64,
    pub(crate) mean: f64,
}

/// `lambda Sigma^-1`, if noise costs.
fn penalty(planning: &Planning) -> Option<DMatrix<f64>> {
    let settings = planning.spec.settings();
    let count = planning.spec.controls();
    let sigma =
        match &settings.sigma {
            Sigma::PerControl(sigma) => DMatrix::from_fn(count, count, |i, j| {
                if i == j { f64::from(sigma[i]).powi(2) } else { 0.0 }
            }),
            Sigma::Covariance(rows) => DMatrix::from_fn(count, count, |i, j| f64::from(rows[i][j])),
        };
    let inverse = sigma.try_inverse()? * f64::from(settings.temperature);
    settings.noise_cost.then_some(inverse)
}

/// Distance within which rounding may decide which cell a place is in, m.
const NEAR: f64 = 4e-6;

/// What a map costs at a place, found by comparing with the sides of its cells.
fn charged(map: &CostMap, [x, y]: [f64; 2]) -> f64 {
    let grid = map.grid();
    let along = |axis: usize, place: f64| {
        let side =
            |cell: usize| f64::from(grid.origin[axis]) + cell as f64 * f64::from(grid.resolution);
        (0..=grid.size[axis]).filter(|cell| side(*cell) <= place).count()
    };
    let at = |x: f64, y: f64| map.cells()[along(1, y) * (grid.size[0] + 2) + along(0, x)];
    let near = [(-NEAR, -NEAR), (-NEAR, NEAR), (NEAR, -NEAR), (NEAR, NEAR)];
    let cost = at(x, y);
    let same = near.iter().all(|(dx, dy)| at(x + dx, y + dy) == cost);
    assert!(same, "rounding decides the cell of ({x}, {y}): take another seed");
    f64::from(cost)
}

/// The cost of a sample.
fn cost_of<S, C, const NX: usize, const NU: usize, const NC: usize>(
    (system, cost): (&S, &C),
    planning: &Planning,
    problem: &MppiProblem,
    controls: &[f32],
) -> f64
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    let penalty = penalty(planning);
    let mut x: [f64; NX] = from_fn(|i| f64::from(problem.start[i]));
    let mut total = 0.0;
    for (t, u) in controls.as_chunks::<NU>().0.iter().enumerate() {
        let u = u.map(f64::from);
        let value = planning.value.as_ref().map(|term| term.network.forward(&x)[0]);
        let push = planning.disturbance.as_ref().map(|asked| asked.network.forward(&x));
        total += cost.stage(x, u, from_fn(|i| f64::from(problem.context[t * NC + i])));
        if let Some(Lookup { map, place }) = cost.map(x) {
            total += charged(map, place);
        }
        if let Some(penalty) = &penalty {
            let nominal: [f64; NU] = from_fn(|i| f64::from(problem.plan[t * NU + i]));
            for i in 0..NU {
                for j in 0..NU {
                    total += nominal[i] * penalty[(i, j)] * (u[j] - nominal[j]);
                }
            }
        }
        if let (Some(term), Some(value)) = (&planning.value, value) {
            let short = f64::max(0.0, f64::from(term.threshold) - value);
            total += f64::from(term.weight) * short * short;
        }
        x = system.step(x, u);
        if let (Some(asked), Some(push)) = (&planning.disturbance, push) {
            for ((state, scale), push) in asked.entries.iter().zip(push) {
                x[*state] += f64::from(*scale) * push;
            }
        }
    }
    let end = problem.context.len() - NC;
    let terminal = cost.terminal(x, from_fn(|i| f64::from(problem.context[end + i])));
    total + terminal.unwrap_or(0.0)
}

/// The result of `problem` in an iteration, all samples of which have finite costs.
pub(crate) fn truth<S, C, const NX: usize, const NU: usize, const NC: usize>(
    plant: (&S, &C),
    planning: &Planning,
    (problem, iteration): (&MppiProblem, u32),
) -> Truth
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    let settings = planning.spec.settings();
    let samples = 0..settings.samples;
    let controls: Vec<_> = samples.map(|k| planning.controls(problem, iteration, k)).collect();
    let costs: Vec<f64> = controls.iter().map(|u| cost_of(plant, planning, problem, u)).collect();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let raw = |cost: &f64| (-(cost - least) / f64::from(settings.temperature)).exp();
    let weights: Vec<f64> = costs.iter().map(raw).collect();
    let sum: f64 = weights.iter().sum();
    let mut plan = vec![0.0; problem.plan.len()];
    for (weight, controls) in weights.iter().zip(&controls) {
        for (mean, u) in plan.iter_mut().zip(controls) {
            *mean += weight / sum * f64::from(*u);
        }
    }
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    let mean = costs.iter().sum::<f64>() / costs.len() as f64;
    Truth { costs, plan, effective_samples: sum * sum / squares, mean }
}

/// What is wrong with `result`, whose f32 twin on the host is `host`.
///
/// A GPU may contract products and adds up in another order, each of which changes rounding by a
/// small factor: it may lie 8 times as far from f64 as the host's worst sample does. The floors are
/// those of f32 sums of these lengths: 1e-6 of the largest cost, 1e-5 of a control's range.
pub(crate) fn differences(
    truth: &Truth,
    result: &MppiResult,
    host: &MppiResult,
    settings: &MppiSettings,
) -> Result<(), String> {
    let MppiSettings { temperature, bounds, .. } = settings;
    let temperature = *temperature;
    let apart = |a: &[f32]| -> f64 {
        let gaps = a.iter().zip(&truth.costs).map(|(a, b)| (f64::from(*a) - b).abs());
        gaps.fold(0.0, f64::max)
    };
    let largest = truth.costs.iter().fold(0.0, |most, cost| f64::max(most, cost.abs()));
    let band = 8.0 * apart(&host.costs) + 1e-6 * largest;
    let within = |what: &str, have: f64, want: f64, band: f64| match (have - want).abs() <= band {
        true => Ok(()),
        false => Err(format!("{what}: {have}, f64 {want}, band {band}")),
    };
    if result.costs.len() != truth.costs.len() || result.non_finite != 0 {
        return Err(format!("{} costs, {} infinite", result.costs.len(), result.non_finite));
    }
    for (k, (cost, truth)) in result.costs.iter().zip(&truth.costs).enumerate() {
        within(&format!("cost of {k}"), f64::from(*cost), *truth, band)?;
    }
    let least = result.costs.iter().copied().fold(f32::INFINITY, f32::min);
    let first = result.costs.iter().position(|cost| *cost == least);
    if result.least_cost != least || Some(result.best as usize) != first {
        return Err(format!("best {} at {}, is {first:?}", result.least_cost, result.best));
    }
    within("mean", result.mean_cost, truth.mean, band)?;
    // A relative error d of each weight changes the number by at most 4 d.
    let relative = 8.0 * band / f64::from(temperature) + 1e-5;
    let samples = truth.effective_samples;
    within("effective samples", result.effective_samples, samples, relative * samples)?;
    for (i, wanted) in truth.plan.iter().enumerate() {
        let [low, high] = bounds[i % bounds.len()];
        let range = f64::from(high - low);
        let own = (f64::from(host.plan[i]) - wanted).abs();
        let band = 8.0 * own + (1e-5 + 2.0 * band / f64::from(temperature)) * range;
        let what = format!("control {} of step {}", i % bounds.len(), i / bounds.len());
        within(&what, f64::from(result.plan[i]), *wanted, band)?;
    }
    Ok(())
}
