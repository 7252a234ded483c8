//! Sweep records for the tests of the page: plausible numbers from closed formulas, nothing run.
#![allow(dead_code, reason = "each test file uses its own part")]

use reachcast::race::judge::{FailureClass, Judge};
use reachcast::race::record::{CeilingRecord, FailureRecord, JudgedRecord, StartsRecord};
use reachcast::race::sweep::record::{
    AxisRecord, CertificatePoint, LatencyRecord, PointRecord, PointResult, RacePoint, SWEEP_SCHEMA,
    SweepRecord,
};
use reachcast::scenario::record::{GrowthOutcome, Provenance};

const STARTS: u64 = 500;
/// Samples of the realistic sweep.
pub(crate) const SAMPLES: [&str; 9] =
    ["16", "32", "64", "128", "256", "512", "1024", "2048", "4096"];
/// Its horizons.
pub(crate) const HORIZONS: [&str; 3] = ["10", "20", "30"];

/// Parameters and the values that they take.
pub(crate) type Axes<'a> = &'a [(&'a str, &'a [&'a str])];

/// Races over samples and horizons: success rises with both and levels off, latency with K H.
pub(crate) fn races() -> SweepRecord {
    race_grid(&[("controller", &["mppi"]), ("samples", &SAMPLES), ("horizon", &HORIZONS)])
}

/// Certificates over the risk and the bound that is used.
pub(crate) fn certificates() -> SweepRecord {
    certificate_grid(&[
        ("epsilon", &["0.01", "0.02", "0.05", "0.1", "0.2"]),
        ("bound", &["scenario", "exact"]),
    ])
}

/// A full grid of races.
pub(crate) fn race_grid(axes: Axes<'_>) -> SweepRecord {
    let mut record = grid(axes, |point| PointResult::Race(race(point)));
    let ceilings = [(Judge::Study, 480), (Judge::Paper, 403), (Judge::Rigorous, 479)];
    record.starts = Some(StartsRecord {
        source: "configs/race_starts_500.csv".to_owned(),
        count: STARTS,
        sha256: "c0ffee42".repeat(8),
        ceilings: ceilings.map(|(judge, safe)| CeilingRecord { judge, safe }).to_vec(),
    });
    record.noise_seeds = vec![1, 2];
    record.judge = Some(Judge::Rigorous);
    record
}

/// A full grid of certificates.
pub(crate) fn certificate_grid(axes: Axes<'_>) -> SweepRecord {
    grid(axes, |point| PointResult::Certificate(certificate(point)))
}

/// The values of one point by the names of their axes.
pub(crate) struct Values<'a>(Vec<(&'a str, &'a str)>);

impl Values<'_> {
    fn number(&self, axis: &str, other: f64) -> f64 {
        let value = self.0.iter().find(|(name, _)| *name == axis);
        value.and_then(|(_, text)| text.parse().ok()).unwrap_or(other)
    }

    /// A number from 0 to 1 that depends on every value.
    fn wobble(&self) -> f64 {
        let bytes = self.0.iter().flat_map(|(name, text)| name.bytes().chain(text.bytes()));
        f64::from(bytes.fold(7_u32, |hash, byte| hash.wrapping_mul(31) + u32::from(byte)) % 1000)
            / 1000.0
    }
}

fn grid(axes: Axes<'_>, result: impl Fn(&Values<'_>) -> PointResult) -> SweepRecord {
    let mut points: Vec<Vec<(&str, &str)>> = vec![Vec::new()];
    for (name, values) in axes {
        let longer = points.iter().flat_map(|point| {
            values.iter().map(move |value| [&point[..], &[(*name, *value)]].concat())
        });
        points = longer.collect();
    }
    let points: Vec<_> = points
        .into_iter()
        .enumerate()
        .map(|(index, values)| PointRecord {
            sha256: format!("{index:064x}"),
            values: values.iter().map(|(_, value)| (*value).to_owned()).collect(),
            result: result(&Values(values)),
            events: Vec::new(),
        })
        .collect();
    let axis = |(name, values): &(&str, &[&str])| AxisRecord {
        name: (*name).to_owned(),
        values: values.iter().map(|value| (*value).to_owned()).collect(),
    };
    SweepRecord {
        schema: SWEEP_SCHEMA,
        provenance: provenance(),
        starts: None,
        noise_seeds: Vec::new(),
        judge: None,
        axes: axes.iter().map(axis).collect(),
        total: points.len() as u64,
        points,
        notes: Vec::new(),
    }
}

fn provenance() -> Provenance {
    Provenance {
        version: "0.1.0-test".to_owned(),
        seed: 20_260_131,
        generator: "philox4x32-10".to_owned(),
        config: serde_json::json!({"profile": "rigorous", "race": {"judge": "rigorous"}}),
        policy: "three layers of 64, relu, tanh".to_owned(),
        policy_sha256: "0123abcd".repeat(8),
        physics_sha256: "89efba76".repeat(8),
        backend: "cpu".to_owned(),
        device: "a test machine".to_owned(),
        networks: None,
    }
}

fn race(point: &Values<'_>) -> RacePoint {
    let (samples, horizon) = (point.number("samples", 512.0), point.number("horizon", 20.0));
    let wobble = point.wobble();
    let level = 1.0 - (-(samples / 60.0).powf(0.6)).exp();
    let reach = [0.86, 1.0, 0.94][usize::from(horizon > 15.0) + usize::from(horizon > 25.0)];
    let share = (0.17 + 0.51 * level) * reach + 0.015 * (wobble - 0.5);
    let median = 2.0e-5 + 3.9e-9 * samples * horizon * (1.0 + 0.1 * wobble);
    RacePoint {
        races: STARTS * 2,
        judged: [(Judge::Study, 0.05), (Judge::Paper, -0.2), (Judge::Rigorous, 0.0)]
            .map(|(judge, more)| judged(judge, (share + more).clamp(0.0, 0.95)))
            .to_vec(),
        effective_samples: Some(1.0 + samples * (0.04 + 0.02 * wobble)),
        best_cost: Some(-12.0 + 60.0 * horizon / samples.sqrt()),
        non_finite_samples: 3,
        latency: LatencyRecord {
            steps: 200,
            median_seconds: median,
            p95_seconds: median * (1.2 + 0.2 * wobble),
            p99_seconds: median * (1.7 + 0.5 * wobble),
        },
        batch_seconds: median * 0.8,
    }
}

/// `share` of the races won, the rest lost in every class.
pub(crate) fn judged(judge: Judge, share: f64) -> JudgedRecord {
    let won = (share * STARTS as f64).round() as u64;
    let successes = vec![won, (won + 3).min(STARTS)];
    let all: u64 = successes.iter().sum();
    let lost = 2 * STARTS - all;
    let [start, collision, fence] = [lost / 12, lost / 3, lost / 4];
    let [missed, overtaken] = [lost / 8, lost / 9];
    let timeout = lost - start - collision - fence - missed - overtaken;
    let counts = [start, 0, collision, fence, missed, overtaken, timeout];
    let (first, rate) = (won as f64 / STARTS as f64, all as f64 / (2.0 * STARTS as f64));
    let reach = 1.96 * (first * (1.0 - first) / STARTS as f64).sqrt() + 0.002;
    JudgedRecord {
        judge,
        successes,
        rate,
        interval: [(first - reach).max(0.0), (first + reach).min(1.0)],
        spread: Some(0.004_24),
        failures: FailureClass::ALL
            .iter()
            .zip(counts)
            .map(|(&class, count)| FailureRecord { class, count })
            .collect(),
        published: None,
        against_hybrid: None,
    }
}

fn certificate(point: &Values<'_>) -> CertificatePoint {
    let epsilon = point.number("epsilon", 0.1);
    let radius = point.number("radius", 0.1);
    let exact = point.0.contains(&("bound", "exact"));
    let scenarios = if exact { 0 } else { (6.9078 / epsilon * 2.3).ceil() as u64 };
    let bound = radius * if exact { 3.303 } else { 2.743 - 0.1 * epsilon.ln() };
    let share = (0.12 - 0.13 * bound).max(0.0);
    let accepted = (20_000.0 * share) as u64;
    let verified = bound < 0.42;
    CertificatePoint {
        deviation_scenarios: scenarios,
        deviation_risk: 0.43 * epsilon,
        deviation_bound: bound,
        draws: 20_000,
        accepted,
        share_interval: [(share - 0.006).max(0.0), share + 0.006],
        volume_interval: [(share - 0.006).max(0.0) * 73.728, (share + 0.006) * 73.728],
        conditional_risk: 0.0048,
        growth_scenarios: (16.0 / epsilon) as u64,
        growth: if verified { GrowthOutcome::Verified } else { GrowthOutcome::Exhausted },
        rounds: if verified { 7 } else { 10 },
        radius: if verified { 0.5 * (0.42 - bound) } else { 0.0 },
        holds: verified,
        beta_total: 0.004,
        seconds: 0.31,
    }
}
