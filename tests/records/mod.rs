//! Records for the tests of the report: realistic numbers from closed formulas, no certificate run.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::collections::BTreeMap;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::race::DroneRace;
use reachcast::rollout::{PairControl, reach_avoid};
use reachcast::scenario::growth_plan::Around;
use reachcast::scenario::record::{
    Claim, ConstantRecord, ConstantsRecord, DeviationRecord, GlobalRecord, GrowthOutcome,
    GrowthRecord, PictureRecord, Provenance, Record, RolloutRecord, RoundRecord, SCHEMA,
    SampleRecord, SliceAxisRecord, SliceRecord, Spending, StateRecord, SystemRecord, Timing,
};
use reachcast::scenario::settings::{BoundarySearch, DeviationSource, Joint};
use reachcast::system::{DoubleIntegrator, System};

const GAMMA: f64 = 0.95;
const HORIZON: u32 = 30;

/// What differs between the two systems.
struct Study<'a, const NX: usize, const NU: usize, S> {
    system: &'a S,
    policy: &'a dyn Fn([f64; NX]) -> [f64; NU],
    state: [f64; NX],
    axes: [(usize, Vec<f32>); 2],
    center: [f64; NX],
    radius: f64,
    constants: [f64; 2],
    deviation: f64,
    varies: [bool; NX],
}

impl<const NX: usize, const NU: usize, S: System<NX, NU>> Study<'_, NX, NU, S> {
    /// Growth of the distance over the steps, with the bump that velocities give at first.
    fn bound(&self) -> Vec<f64> {
        let step = |t: u32| {
            let bump = 0.35 * f64::from(t) * (1.0 - f64::from(t)).exp();
            self.deviation * (1.0 + 0.07 * f64::from(t) + bump)
        };
        (0..=HORIZON).map(step).collect()
    }

    fn rollout(&self, mut x: [f64; NX]) -> Vec<[f64; NX]> {
        let mut states = vec![x];
        for _ in 0..HORIZON {
            x = self.system.step(x, (self.policy)(x));
            states.push(x);
        }
        states
    }

    fn measure(&self, x: [f64; NX], bound: &[f64]) -> f64 {
        let states = self.rollout(x);
        let margins = states.iter().zip(bound).map(|(&x, &distance)| {
            (
                self.system.target(x) - self.constants[0] * distance,
                self.system.constraint(x) - self.constants[1] * distance,
            )
        });
        reach_avoid(margins, GAMMA)
    }

    fn success(&self, x: [f64; NX]) -> bool {
        self.measure(x, &[0.0; HORIZON as usize + 1]) > 0.0
    }

    /// A point of the ball in the coordinates that vary, of its own for each index.
    fn near(&self, center: [f64; NX], reach: f64, index: usize) -> [f64; NX] {
        let mut random = StdRng::seed_from_u64(index as u64);
        let direction = self.varies.map(|varies| {
            // A sum of uniforms is near enough to a normal for a picture.
            let normal = (0..6).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
            if varies { normal } else { 0.0 }
        });
        let norm = direction.iter().map(|value| value * value).sum::<f64>().sqrt();
        let length = reach * random.random::<f64>().powf(1.0 / NX as f64) / norm;
        std::array::from_fn(|state| center[state] + length * direction[state])
    }

    fn slice(&self) -> SliceRecord {
        let [(x, across), (y, up)] = &self.axes;
        let bound = self.bound();
        let states: Vec<[f64; NX]> = up
            .iter()
            .flat_map(|&v| across.iter().map(move |&u| (u, v)))
            .map(|(u, v)| {
                let mut state = self.state;
                (state[*x], state[*y]) = (f64::from(u), f64::from(v));
                state
            })
            .collect();
        let map = |value: &dyn Fn([f64; NX]) -> f64| {
            states.iter().map(|&state| value(state) as f32).collect()
        };
        let axis = |(state, values): &(usize, Vec<f32>)| SliceAxisRecord {
            state: *state,
            values: values.clone(),
        };
        SliceRecord {
            x: axis(&self.axes[0]),
            y: axis(&self.axes[1]),
            check_margin: map(&|state| self.measure(state, &bound)),
            target_margin: map(&|state| self.system.target(state)),
            constraint_margin: map(&|state| self.system.constraint(state)),
        }
    }

    fn record(&self, policy: &str) -> Record {
        let bound = self.bound();
        let short = |x: &[f64; NX]| x.map(|value| value as f32).to_vec();
        let rollouts = (0..6).map(|index| {
            let start = self.near(self.state, 0.5, index + 3);
            RolloutRecord {
                states: self.rollout(start).iter().map(short).collect(),
                success: self.success(start),
            }
        });
        let samples = (0..159).map(|index| SampleRecord {
            x: short(&self.near(self.center, self.radius, index)),
            success: true,
        });
        let dimension = self.varies.iter().filter(|&&varies| varies).count();
        let distance = (0..NX).map(|i| (self.center[i] - self.state[i]).powi(2)).sum::<f64>();
        let round = |radius, failures, nearest_failure| RoundRecord {
            radius,
            scenarios: 159,
            failures,
            nearest_failure,
            non_finite: 0,
            f64_reruns: 2,
        };
        Record {
            schema: SCHEMA,
            digests: BTreeMap::new(),
            holds: true,
            statements: statements(self.radius),
            provenance: provenance(policy),
            system: SystemRecord {
                between: 0,
                task: reachcast::model::Task::default(),
                name: self.system.name().to_owned(),
                states: self.system.states().to_vec(),
                controls: self.system.controls().to_vec(),
                bodies: self.system.bodies(),
            },
            horizon: HORIZON,
            gamma: GAMMA,
            constants: constants(self.constants),
            deviation: deviation(&bound, self.deviation, NX),
            global: global(NX),
            whole_box: None,
            drops: None,
            enclosed: None,
            sequence: None,
            calibration: None,
            deterministic: None,
            state: StateRecord {
                x: short(&self.state),
                tier: if self.measure(self.state, &bound) > 0.0 { 1 } else { 2 },
                check_margin: self.measure(self.state, &bound),
                target_margin: self.system.target(self.state),
                constraint_margin: self.system.constraint(self.state),
            },
            slice: self.slice(),
            growth: GrowthRecord {
                around: Around::Set,
                outcome: GrowthOutcome::Verified,
                boundary: BoundarySearch::Rays,
                center: Some(short(&self.center)),
                distance: Some(distance.sqrt()),
                radius: self.radius,
                volume: 0.007_312,
                varies: self.varies.to_vec(),
                rounds: vec![
                    round(0.55, 23, Some(0.4313)),
                    round(0.4313, 4, Some(self.radius)),
                    round(self.radius, 0, None),
                ],
                claim: Some(Claim {
                    measure: format!(
                        "the uniform distribution on a ball in {dimension} coordinates"
                    ),
                    dimension,
                    ..claim("growth", 0.0571)
                }),
                samples: samples.collect(),
                upward: None,
            },
            sequential: None,
            attempt: None,
            ledger: ledger(),
            beta_total: 4e-3,
            picture: PictureRecord { rollouts: rollouts.collect(), drawn: None },
            events: Vec::new(),
            timing: Timing { wall_seconds: 1.2346, threads: 2, rollouts: 123_456 },
        }
    }
}

fn statements(radius: f64) -> Vec<String> {
    vec![
        "With confidence 0.999 over the draw of 159 pairs, a pair exceeds the deviation bound at \
         some step with probability at most 0.1."
            .to_owned(),
        "With confidence 0.999, a start drawn from the box and found inside the certified set \
         fails to reach the target safely with probability at most 0.0119."
            .to_owned(),
        format!(
            "With confidence 0.999, a start drawn uniformly from the ball of radius {radius} \
             around the boundary point fails with probability at most 0.1."
        ),
    ]
}

fn provenance(policy: &str) -> Provenance {
    Provenance {
        version: "0.1.0".to_owned(),
        seed: 20_260_131,
        generator: "Philox4x32-10".to_owned(),
        config: serde_json::json!({
            "system": { "name": "drone-race", "cone": "distance" },
            "deviation": { "epsilon": 0.1, "beta": 1e-3, "radius": 0.1 },
        }),
        policy: policy.to_owned(),
        policy_sha256: "5b1e9f0c6a7d42e38f90b1c2d3e4f5061728394a5b6c7d8e9f00112233445566"
            .to_owned(),
        physics_sha256: "c0ffee00112233445566778899aabbccddeeff00112233445566778899aabbcc"
            .to_owned(),
        backend: "cpu".to_owned(),
        device: "16 lanes of f32, AVX-512".to_owned(),
        networks: None,
    }
}

fn claim(name: &str, certified_risk: f64) -> Claim {
    Claim {
        name: name.to_owned(),
        statement: format!("The {name} claim in words."),
        measure: "the uniform distribution on the box".to_owned(),
        dimension: 12,
        frozen: Vec::new(),
        scenarios: 159,
        failures: 0,
        decision_vars: 1,
        epsilon: Some(0.1),
        beta: 1e-3,
        beta_used: 2e-4,
        required_simple: Some(191),
        required_exact: Some(81),
        certified_risk,
    }
}

fn constants([target, constraint]: [f64; 2]) -> ConstantsRecord {
    let constant = |used: f64| ConstantRecord {
        used,
        source: "computed".to_owned(),
        computed: used,
        sampled: 0.998 * used,
        assumed_continuous: Some(false),
        hulled: Some(false),
    };
    ConstantsRecord {
        target: constant(target),
        constraint: constant(constraint),
        region: None,
        assumed: Vec::new(),
    }
}

fn deviation(bound: &[f64], radius: f64, dimension: usize) -> DeviationRecord {
    let scaled = |factor: f64| bound.iter().map(|&value| factor * value).collect();
    DeviationRecord {
        claim: Claim {
            measure: format!(
                "nominal starts uniform in the box, perturbed starts uniform in a ball of radius \
                 {radius} in {dimension} coordinates"
            ),
            dimension,
            ..claim("deviation", 0.0426)
        },
        radius,
        control: PairControl::Replay,
        joint: Joint::FixedShape,
        source: DeviationSource::Scenario,
        bound: bound.to_vec(),
        largest: bound
            .iter()
            .enumerate()
            .map(|(step, value)| value * (0.9 + 0.09 * (step as f64).sin()))
            .collect(),
        exact: Some(scaled(1.08)),
        pilot: 1000,
        scale: Some(1.037),
        support: 1,
        posterior_risk: 0.0723,
        non_finite: 0,
    }
}

fn global(dimension: usize) -> GlobalRecord {
    GlobalRecord {
        claim: Claim {
            dimension,
            scenarios: 1377,
            failures: 4,
            required_simple: None,
            required_exact: None,
            ..claim("global", 0.0119)
        },
        draws: 100_000,
        accepted: 1377,
        share_interval: [0.012_61, 0.015_02],
        box_volume: 73.728,
        volume_interval: [0.9297, 1.1074],
        reached: 31_415,
        non_finite: 3,
        f32_error: 7.3e-7,
        f32_apart: Some(0),
        band: 2.92e-6,
        f64_reruns: 17,
        share: None,
    }
}

fn ledger() -> Vec<Spending> {
    [
        ("deviation", "all steps", 1e-3),
        ("global", "conditional failure", 1e-3),
        ("global", "share of the box", 1e-3),
        ("growth", "5 rounds at 2e-4", 1e-3),
    ]
    .map(|(claim, item, beta)| Spending { claim: claim.to_owned(), item: item.to_owned(), beta })
    .to_vec()
}

fn range(low: f32, step: f32, count: usize) -> Vec<f32> {
    (0..count).map(|index| low + step * index as f32).collect()
}

/// The race in twelve states, with bodies.
pub(crate) fn race() -> Record {
    let policy = |x: [f64; 12]| {
        [
            (-1.6 * x[0] - 2.4 * x[1]).clamp(-1.0, 1.0),
            (3.0 * (0.95 - x[3])).clamp(-1.0, 1.0),
            (-1.6 * x[4] - 2.4 * x[5]).clamp(-1.0, 1.0),
        ]
    };
    let state = [0.45, 0.0, -2.2, 0.7, 0.05, 0.0, -0.35, 0.0, -1.9, 0.35, 0.0, 0.0];
    let mut center = state;
    (center[0], center[2], center[3]) = (0.31, -1.93, 0.74);
    Study {
        system: &DroneRace::default(),
        policy: &policy,
        state,
        axes: [(0, range(-0.9, 0.1, 18)), (2, range(-2.6, 0.1, 26))],
        center,
        radius: 0.283_17,
        constants: [14.1422, 14.4223],
        deviation: 0.1,
        varies: [true; 12],
    }
    .record("MLP 12-64-64-3, tanh")
}

/// The double integrator in two states, without bodies.
pub(crate) fn double_integrator() -> Record {
    let policy = |[x, v]: [f64; 2]| [(-3.0 * x - 2.5 * v).clamp(-1.0, 1.0)];
    let mut record = Study {
        system: &DoubleIntegrator::default(),
        policy: &policy,
        state: [0.8, 0.25],
        axes: [(0, range(-1.2, 0.04, 61)), (1, range(-1.5, 0.05, 61))],
        center: [0.77, 0.21],
        radius: 0.12,
        constants: [1.0, 1.0],
        deviation: 0.02,
        varies: [true; 2],
    }
    .record("bang-bang");
    // One round of failures, so that the picture has both marks.
    record.holds = false;
    record.statements[2] = "Local growth was exhausted: no ball is certified.".to_owned();
    record.growth.outcome = GrowthOutcome::Exhausted;
    record.growth.claim = None;
    record.growth.radius = 0.0;
    for (index, sample) in record.growth.samples.iter_mut().enumerate() {
        sample.success = index % 9 != 0;
    }
    record.growth.rounds.iter_mut().for_each(|round| round.failures += 2);
    record
}
