//! The conditional failure and the share of the certified set, against a loop of its own.

use crate::common::{ClosedForm, FALSE_ALARM, cpu, literal, settings, supremum};
use crate::{BETA, CERTIFICATES, violates};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::model::Plant;
use reachcast::rollout::Tightening;
use reachcast::scenario::bound::certified_risk;
use reachcast::scenario::criterion::Criterion;
use reachcast::scenario::purpose;
use reachcast::scenario::{Context, Unwatched, deviation, global};
use reachcast::system::{BangBang, DoubleIntegrator};
use statrs::distribution::{Beta, ContinuousCDF};

/// Largest perturbation of the conditional test: large, so that failures are common.
const PERTURBATION: f64 = 0.3;
/// Steps of the conditional test.
const STEPS: usize = 15;
/// Constant of both margins there: far below the valid 1.
const SMALL_CONSTANT: f64 = 0.02;

/// The conditional failure in truth: failures and certified starts among a million pairs, rolled
/// out by a loop of the test's own.
fn conditional_failures(tightening: &Tightening) -> [u64; 2] {
    let mut rng = StdRng::seed_from_u64(7_777);
    let dt = literal(0.1);
    let (mut failures, mut certified) = (0, 0);
    for _ in 0..2_000_000 {
        let nominal = [rng.random_range(-1.2..1.2), rng.random_range(-1.5..1.5)];
        let offset = loop {
            let offset: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            if offset[0] * offset[0] + offset[1] * offset[1] <= 1.0 {
                break offset.map(|e| PERTURBATION * e);
            }
        };
        let mut states = [nominal, [nominal[0] + offset[0], nominal[1] + offset[1]]];
        let (mut alive, mut reached) = ([true; 2], [false; 2]);
        for t in 0..=STEPS {
            let loss = [[tightening.target[t], tightening.constraint[t]].map(f64::from), [0.0; 2]];
            for (i, [position, _]) in states.iter().enumerate() {
                alive[i] &= 1.0 - position.abs() - loss[i][1] > 0.0;
                reached[i] |= alive[i] && 0.25 - position.abs() - loss[i][0] > 0.0;
            }
            let control = if states[0][0] < 0.0 { 1.0 } else { -1.0 };
            for [position, velocity] in &mut states {
                *position += dt * *velocity;
                *velocity += dt * control;
            }
        }
        certified += u64::from(reached[0]);
        failures += u64::from(reached[0] && !reached[1]);
    }
    assert!(certified >= 1_000_000, "only {certified} certified starts");
    [failures, certified]
}

/// The conditional failure bound and the interval of the certified share, over all seeds.
#[test]
fn conditional_failure_bounds_are_false_at_most_as_often_as_claimed() {
    let backend = cpu(1);
    let system = DoubleIntegrator::default();
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let program = backend.prepare(&plant).expect("a program");
    let context = Context { program: &program, watch: &Unwatched };
    let mut settings = settings(&system, STEPS as u32);
    settings.deviation.radius = PERTURBATION as f32;
    settings.global.beta = BETA;
    settings.global.draws = 150;
    let bound = supremum(&system, PERTURBATION, STEPS as u32);
    let tightening = deviation::tightening(&bound, SMALL_CONSTANT, SMALL_CONSTANT, &settings.spec);
    let [failures, certified] = conditional_failures(&tightening);
    // Clopper and Pearson's lower end: the true probability is at least this.
    let below = Beta::new(failures as f64, (certified - failures + 1) as f64).expect("beta");
    let truth = below.inverse_cdf(FALSE_ALARM);
    println!("conditional failure: {failures} of {certified}, at least {truth}");
    assert!(truth > 0.03 && truth < 0.5, "{truth}");
    let loss: Vec<f64> = tightening.target.iter().copied().map(f64::from).collect();
    let share = ClosedForm::of(&system).share(literal(1.2), literal(1.5), &loss);
    let criterion = Criterion::Margins(tightening.clone());
    let (mut false_bounds, mut false_halves, mut false_shares) = (0, 0, 0);
    for seed in 0..CERTIFICATES {
        settings.seed = seed;
        let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
        let record = global::conditional(context, &settings, &criterion, purposes)
            .expect("conditional failure");
        let (n, k) = (record.accepted, record.claim.failures);
        assert_eq!(record.claim.certified_risk, certified_risk(n, k, BETA));
        false_bounds += u64::from(record.claim.certified_risk < truth);
        // Half the pairs that the claim says it has.
        false_halves += u64::from(certified_risk(2 * n, 2 * k, BETA) < truth);
        let [low, high] = record.share_interval;
        false_shares += u64::from(!(low..=high).contains(&share));
    }
    assert!(!violates("conditional failure", false_bounds));
    assert!(violates("conditional failure, half", false_halves));
    assert!(!violates("certified share", false_shares));
}
