//! The same seed gives the same certificate, and a stored certificate is checked and queried.

use crate::common::{cpu, race_policy, race_settings, settings};
use reachcast::Error;
use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::rollout::States;
use reachcast::scenario::record::{GrowthOutcome, Record, Timing};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Unwatched, certify, check, query};
use reachcast::system::{BangBang, DoubleIntegrator};

fn program<'a>(backend: &'a Backend, plant: &Plant) -> Program<'a> {
    backend.prepare(plant).expect("a program")
}

fn certificate(program: &Program<'_>, settings: &Settings) -> Record {
    let config = serde_json::json!({ "seed": settings.seed });
    certify(program, settings, config, &Unwatched).expect("certificate")
}

/// The certificate as JSON, but for its timing.
fn text(record: &Record) -> String {
    let mut record = record.clone();
    record.timing = Timing { wall_seconds: 0.0, threads: 0, rollouts: record.timing.rollouts };
    serde_json::to_string(&record).expect("JSON")
}

/// Equal texts; where not, what surrounds the first difference.
fn assert_same(a: &str, b: &str) {
    let differ = |(x, y): (u8, u8)| x != y;
    let Some(at) = a.bytes().zip(b.bytes()).position(differ) else {
        return assert_eq!(a.len(), b.len());
    };
    let around = |text: &str| {
        let bytes = &text.as_bytes()[at.saturating_sub(120)..text.len().min(at + 40)];
        String::from_utf8_lossy(bytes).into_owned()
    };
    panic!("{}\nis not\n{}", around(a), around(b));
}

/// The race with the trained network.
fn race() -> (Plant, Settings) {
    let system = DroneRace::default();
    let settings = race_settings(&system);
    (Plant::of(system, race_policy()), settings)
}

#[test]
fn same_seed_same_certificate_with_one_and_two_threads() {
    let (plant, mut settings) = race();
    let (single, both) = (cpu(1), cpu(2));
    let program_of_both = program(&both, &plant);
    let one = certificate(&program(&single, &plant), &settings);
    let two = certificate(&program_of_both, &settings);
    assert_same(&text(&one), &text(&two));
    // The program as it was left, and one made anew.
    assert_same(&text(&two), &text(&certificate(&program_of_both, &settings)));
    let another = cpu(2);
    assert_same(&text(&two), &text(&certificate(&program(&another, &plant), &settings)));
    settings.seed += 1;
    let other = certificate(&program_of_both, &settings);
    assert_ne!(two.deviation.bound, other.deviation.bound);
    assert_ne!(two.global.accepted, other.global.accepted);
    // It is a certificate of something: a part of the box, and a ball.
    assert!(two.global.accepted > 0 && two.global.accepted < two.global.draws);
    assert_eq!(two.growth.outcome, GrowthOutcome::Verified);
}

#[test]
fn a_certificate_survives_its_file_and_its_check() {
    let (plant, settings) = race();
    let backend = cpu(2);
    let program = program(&backend, &plant);
    let record = certificate(&program, &settings);
    let stored = serde_json::to_string(&record).expect("JSON");
    let read: Record = serde_json::from_str(&stored).expect("record");
    assert_eq!(read, record);
    let report = check(&program, &read, &settings, 7, &Unwatched).expect("check");
    assert!(report.holds, "{:#?}", report.findings);
}

/// The double integrator with bang-bang control, of which a ball beyond the certified set is verified.
fn integrator() -> (Plant, Settings) {
    let system = DoubleIntegrator::default();
    let mut settings = settings(&system, 30);
    settings.state = vec![0.9, 0.6];
    settings.growth.radius = 0.2;
    (Plant::of(system, BangBang { acceleration: 1.0 }), settings)
}

/// Whether a check of the record after `change` refuses it or finds a claim that does not hold.
fn is_caught(change: impl Fn(&mut Record)) -> bool {
    let (plant, settings) = integrator();
    let backend = cpu(2);
    let program = program(&backend, &plant);
    let mut record = certificate(&program, &settings);
    change(&mut record);
    match check(&program, &record, &settings, 7, &Unwatched) {
        Ok(report) => !report.holds,
        Err(Error::Refused(_)) => true,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_changed_certificate_is_caught() {
    assert!(!is_caught(|_| {}), "the certificate as it is holds");
    assert!(is_caught(|record| {
        record.deviation.bound.iter_mut().for_each(|b| *b *= 0.8);
    }));
    assert!(is_caught(|record| record.growth.radius *= 2.0));
    assert!(is_caught(|record| record.global.accepted += 50));
    assert!(is_caught(|record| record.global.claim.certified_risk *= 0.5));
    assert!(is_caught(|record| record.constants.target.used *= 0.5));
    assert!(is_caught(|record| record.provenance.policy_sha256 = "0".repeat(64)));
    assert!(is_caught(|record| record.provenance.physics_sha256 = "0".repeat(64)));
    assert!(is_caught(|record| record.schema += 1));
    assert!(is_caught(|record| record.statements[0].push_str(" And more.")));
    assert!(is_caught(|record| record.provenance.seed += 1));
    assert!(is_caught(|record| record.gamma = 0.9));
    assert!(is_caught(|record| record.system.states[0].high = 9.0));
    assert!(is_caught(|record| record.deviation.claim.epsilon = Some(0.01)));
    assert!(is_caught(|record| record.deviation.claim.scenarios *= 2));
    assert!(is_caught(|record| record.global.draws *= 1000));
    assert!(is_caught(|record| record.global.share_interval[0] *= 1.1));
    assert!(is_caught(|record| record.growth.varies[1] = false));
    assert!(is_caught(|record| record.slice.check_margin[7] += 0.01));
    assert!(is_caught(|record| record.state.tier = 0));
    assert!(is_caught(|record| record.beta_total *= 0.5));
    // What only says who ran it, and how long it took, is free.
    assert!(!is_caught(|record| record.timing.wall_seconds *= 2.0));
    assert!(!is_caught(|record| record.provenance.device = "another".to_owned()));
}

/// A certificate of another system's parameters is refused, by `check` and by `query`.
#[test]
fn a_certificate_of_another_plant_is_refused() {
    let (plant, settings) = integrator();
    let backend = cpu(2);
    let record = certificate(&program(&backend, &plant), &settings);
    let wider = DoubleIntegrator { corridor: 2.0, ..DoubleIntegrator::default() };
    let other = program(&backend, &Plant::of(wider, BangBang { acceleration: 1.0 }));
    let checked = check(&other, &record, &settings, 1, &Unwatched);
    assert!(matches!(checked, Err(Error::Refused(_))), "{checked:?}");
    let queried = query(&other, &record, &settings, (&[[0.0; 2]]).into());
    assert!(matches!(queried, Err(Error::Refused(_))), "{queried:?}");
}

/// Every tier occurs over the box, each where its definition says.
#[test]
fn tiers_are_those_of_their_definition() {
    let (plant, settings) = integrator();
    let backend = cpu(2);
    let program = program(&backend, &plant);
    let record = certificate(&program, &settings);
    assert_eq!(record.growth.outcome, GrowthOutcome::Verified);
    let center = record.growth.center.clone().expect("centre");
    let node = |i: u16, half: f32| half * (f32::from(2 * i + 1) / 120.0 - 1.0);
    let states: Vec<[f32; 2]> =
        (0..120 * 120).map(|i| [node(i / 120, 1.2), node(i % 120, 1.5)]).collect();
    let rows = query(&program, &record, &settings, (&states).into()).expect("tiers");
    assert_eq!(rows.len(), states.len());
    let mut counts = [0; 4];
    for (x, row) in states.iter().zip(&rows) {
        let square = |i: usize| (f64::from(x[i]) - f64::from(center[i])).powi(2);
        let in_ball = (square(0) + square(1)).sqrt() <= record.growth.radius;
        let tier = if x[0].abs() < 0.25 {
            0
        } else if row.check_margin > 0.0 {
            1
        } else if in_ball {
            2
        } else {
            3
        };
        assert_eq!(row.tier.number(), tier, "{x:?}: {row:?}");
        counts[usize::from(row.tier.number())] += 1;
    }
    println!("states per tier: {counts:?}");
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    // The state of the certificate has the tier that a query finds.
    let own = query(&program, &record, &settings, States::one(&settings.state)).expect("tier");
    assert_eq!(own[0].tier.number(), record.state.tier);
}
