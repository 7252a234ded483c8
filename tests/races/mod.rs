//! A race record for the tests of the page: realistic numbers from closed formulas, no race run.
#![allow(dead_code, reason = "each test file uses its own part")]

use reachcast::race::judge::{FailureClass, Judge};
use reachcast::race::record::{
    AbsentRecord, CeilingRecord, ControllerRecord, FailureRecord, FilterRecord, FrameBall,
    FrameRecord, JudgedRecord, MetricsRecord, PairedRecord, PictureRecord, PublishedRecord,
    RACE_SCHEMA, RaceRecord, StartsRecord, TierRecord,
};
use reachcast::scenario::record::Provenance;

const STARTS: u64 = 500;
const SEEDS: [u64; 5] = [11, 12, 13, 14, 15];
const STEPS: u32 = 80;
/// Moments of the race that is shown.
pub(crate) const FRAMES: usize = 80;
const JUDGES: [(Judge, u64); 3] =
    [(Judge::Study, 480), (Judge::Paper, 403), (Judge::Rigorous, 479)];
const CLASSES: [FailureClass; 7] = FailureClass::ALL;

/// Name, description, published rate with interval, and successes of the first seed per judge.
type Contender = (&'static str, &'static str, [f64; 3], [u64; 3]);

const CONTENDERS: [Contender; 7] = [
    (
        "hybrid",
        "Four tiers: fast MPPI in the target set, the policy where it is certified, recovery MPPI.",
        [0.902, 0.873, 0.927],
        [453, 381, 452],
    ),
    (
        "hybrid-no-policy",
        "The hybrid with MPPI in place of the policy.",
        [0.684, 0.641, 0.725],
        [344, 271, 330],
    ),
    (
        "mppi",
        "MPPI with lane and speed costs, without a safety cost.",
        [0.634, 0.59, 0.676],
        [321, 240, 309],
    ),
    (
        "mppi-soft",
        "MPPI with a soft safety cost of weight 10.",
        [0.632, 0.588, 0.674],
        [317, 243, 311],
    ),
    (
        "mppi-warm",
        "MPPI warm-started with a rollout of the policy.",
        [0.628, 0.584, 0.671],
        [352, 260, 340],
    ),
    ("mppi-cbf", "MPPI behind a control barrier filter.", [0.624, 0.58, 0.667], [312, 246, 305]),
    ("policy", "The reachability policy alone.", [0.518, 0.473, 0.563], [262, 233, 259]),
];

/// Seven controllers under three judges with five noise seeds, and one race of 80 moments.
pub(crate) fn full() -> RaceRecord {
    let ceilings = JUDGES.map(|(judge, safe)| CeilingRecord { judge, safe });
    RaceRecord {
        schema: RACE_SCHEMA,
        provenance: provenance(),
        value_sha256: Some("5a1e".repeat(16)),
        disturbance_sha256: None,
        ppo_sha256: None,
        bounds: None,
        steps: STEPS,
        step_seconds: 0.1,
        starts: StartsRecord {
            source: "configs/race_starts_500.csv".to_owned(),
            count: STARTS,
            sha256: "c0ffee42".repeat(8),
            ceilings: ceilings.to_vec(),
        },
        noise_seeds: SEEDS.to_vec(),
        controllers: CONTENDERS.iter().map(controller).collect(),
        absent: vec![AbsentRecord {
            name: "ppo-cbf".to_owned(),
            reason: "needs --ppo-policy FILE: no PPO policy was given".to_owned(),
        }],
        picture: Some(picture()),
        events: Vec::new(),
        notes: Vec::new(),
    }
}

fn provenance() -> Provenance {
    Provenance {
        version: "0.1.0-test".to_owned(),
        seed: 20_260_131,
        generator: "philox4x32-10".to_owned(),
        config: serde_json::json!({"profile": "rigorous", "mppi": {"samples": 512}}),
        policy: "three layers of 512, relu, tanh".to_owned(),
        policy_sha256: "0123abcd".repeat(8),
        physics_sha256: "89efba76".repeat(8),
        backend: "cpu".to_owned(),
        device: "a test machine".to_owned(),
        networks: None,
    }
}

fn controller(contender: &Contender) -> ControllerRecord {
    let (name, description, _, first) = contender;
    let judged = JUDGES
        .iter()
        .zip(first)
        .map(|(&(judge, safe), &first)| judged(contender, judge, [first, STARTS - safe]));
    let hierarchical = name.starts_with("hybrid");
    ControllerRecord {
        name: (*name).to_owned(),
        description: (*description).to_owned(),
        judged: judged.collect(),
        metrics: Some(metrics(first[2])),
        tiers: hierarchical.then(|| tiers(*name == "hybrid")),
        filter: (*name == "mppi-cbf").then_some(FilterRecord {
            calls: 151_234,
            active: 20_418,
            relaxed: 3_207,
            inaccurate: 16,
            failed: 9,
        }),
        non_finite_samples: 0,
    }
}

/// `won` with the first seed, of which `unsafe_starts` starts are lost at once.
fn judged(contender: &Contender, judge: Judge, [won, unsafe_starts]: [u64; 2]) -> JudgedRecord {
    let (name, _, published, first) = contender;
    let successes = [won, won - 3, won + 2, won - 1, won + 4];
    let all = STARTS * SEEDS.len() as u64;
    let lost = all - successes.iter().sum::<u64>();
    let start = unsafe_starts * SEEDS.len() as u64;
    let rest = lost - start;
    let [collision, fence, missed, overtaken] = [rest / 2, rest / 5, rest / 9, rest / 12];
    let infinite = 3;
    let timeout = rest - infinite - collision - fence - missed - overtaken;
    let counts = [start, infinite, collision, fence, missed, overtaken, timeout];
    let share = won as f64 / STARTS as f64;
    let reach = 1.96 * (share * (1.0 - share) / STARTS as f64).sqrt();
    let hybrid = CONTENDERS[0].3[0] as f64;
    let difference = (first[0] as f64 - hybrid) / STARTS as f64;
    JudgedRecord {
        judge,
        successes: successes.to_vec(),
        rate: (all - lost) as f64 / all as f64,
        interval: [share - reach, share + reach],
        spread: Some(0.005_49),
        failures: CLASSES
            .iter()
            .zip(counts)
            .map(|(&class, count)| FailureRecord { class, count })
            .collect(),
        published: (judge == Judge::Study).then_some(PublishedRecord {
            rate: published[0],
            interval: [published[1], published[2]],
        }),
        against_hybrid: (*name != "hybrid").then_some(PairedRecord {
            only_this: 21,
            only_other: 21 + (hybrid - first[0] as f64) as u64,
            p_value: 1.2345e-17,
            difference,
            interval: [difference - 0.04, difference + 0.04],
        }),
    }
}

fn metrics(races: u64) -> MetricsRecord {
    MetricsRecord {
        judge: Judge::Rigorous,
        races: 5 * races,
        time_seconds: 3.4567,
        path_m: 1.9876,
        jerk: 2.3456,
        acceleration: 0.345_67,
        separation_m: 0.456_78,
        least_separation_m: 0.200_31,
    }
}

fn tiers(policy: bool) -> TierRecord {
    let total = 5.0 * STARTS as f64;
    let occupancy = (0..STEPS).map(|step| {
        let t = f64::from(step) / f64::from(STEPS);
        let over = total * (3.0 * (t - 0.35)).clamp(0.0, 0.97);
        let left = total - over;
        let zero = left * (2.0 * t).clamp(0.0, 0.9);
        let one = if policy { (left - zero) * (0.35 + 0.3 * t) } else { 0.0 };
        let two = if policy { (left - zero - one) * 0.3 } else { 0.0 };
        let [over, zero, one, two] = [over, zero, one, two].map(|races| races.round() as u64);
        [zero, one, two, 5 * STARTS - over - zero - one - two, over]
    });
    TierRecord {
        occupancy: occupancy.collect(),
        shares: [0.3123, 0.2845, 0.1012, 0.302],
        growth_calls: 45_678,
        growth_verified: 34_567,
        growth_rounds: 101_112,
        growth_refused: 17,
        f64_reruns: 1_314,
        beta_deviation: 0.001,
        beta_call: 0.0002,
        beta_race: 0.0131,
        beta_total: 9.137,
    }
}

fn picture() -> PictureRecord {
    let slice_x: Vec<f32> = (0..18).map(|column| -0.9 + 0.1 * column as f32).collect();
    let slice_y: Vec<f32> = (0..26).map(|row| -2.6 + 0.1 * row as f32).collect();
    let frames = (0..FRAMES as u32).map(|step| frame(step, &slice_x, &slice_y));
    PictureRecord {
        controller: "hybrid".to_owned(),
        start: 137,
        noise_seed: 11,
        verdicts: vec![
            (Judge::Study, None),
            (Judge::Paper, Some(FailureClass::Collision)),
            (Judge::Rigorous, None),
        ],
        frames: frames.collect(),
        slice_x,
        slice_y,
    }
}

/// The ego swings round the opponent, from the left, and passes it before the gate.
fn state(step: u32) -> Vec<f32> {
    let t = step as f32 / FRAMES as f32;
    let (x, y) = (-0.5 * (1.0 - t) - 0.25 * (3.1 * t).sin(), -2.3 + 2.5 * t.powf(1.15));
    let (opponent_x, opponent_y) = (0.22 * (1.0 - t).powi(2), -1.75 + 1.6 * t);
    let z = 0.05 - 0.02 * t;
    vec![x, 0.05, y, 0.45 + 0.3 * t, z, -0.02, opponent_x, -0.1, opponent_y, 0.3, 0.09, 0.01]
}

fn frame(step: u32, slice_x: &[f32], slice_y: &[f32]) -> FrameRecord {
    let x = state(step);
    let last = step + 1 == FRAMES as u32;
    let t = step as f32 / FRAMES as f32;
    let tier = [3_u8, 2, 1, 0][(4.0 * t) as usize];
    let certified = |column: f32, row: f32| {
        let away = (column - x[6]).hypot(row - x[8]);
        let near = row > -2.0 + 0.6 * t || (column + 0.6).abs() < 0.15;
        away > 0.33 && near && row < -0.08 - 1.1 * column.abs() && row > x[8] - 0.5
    };
    let cells = slice_y.iter().flat_map(|&row| slice_x.iter().map(move |&column| (column, row)));
    let plans = (0..30).map(|plan| {
        let turn = (plan as f32 - 14.5) / 15.0;
        let points = (0..20).map(|point| {
            let ahead = 0.05 * point as f32;
            [x[0] + turn * ahead * ahead + 0.1 * ahead, x[2] + 0.8 * ahead]
        });
        points.collect()
    });
    FrameRecord {
        step,
        u: (!last).then(|| vec![0.25, 0.7 - t, -0.05]),
        tier: (!last).then_some(tier),
        check_margin: Some(if tier == 1 { 0.1234 } else { -0.4321 * (1.0 - t) }),
        certified: Some(cells.map(|(column, row)| certified(column, row)).collect()),
        ball: (tier >= 2).then_some(FrameBall {
            center: [x[0] + 0.06, x[2] + 0.1],
            radius: 0.1375 + 0.1 * t,
            verified: tier == 2,
            rounds: if tier == 2 { 3 } else { 5 },
        }),
        recovery: (tier == 3).then_some([x[0] + 0.1, x[2] + 0.4]),
        fan: if tier == 3 || tier == 0 { plans.collect() } else { Vec::new() },
        x,
    }
}
