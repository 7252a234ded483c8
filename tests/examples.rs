//! The examples do what they say, on every backend.

mod common;

#[path = "../examples/certificate.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod certificate;
#[path = "../examples/given_at_run_time.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod given_at_run_time;
#[path = "../examples/measures.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod measures;
#[path = "../examples/plan.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod plan;

use reachcast::scenario::record::GrowthOutcome;

#[test]
fn a_system_of_ones_own_is_certified_on_every_backend() {
    let records: Vec<_> = common::backends()
        .iter()
        .map(|backend| certificate::certificate(backend).expect("certificate"))
        .collect();
    for record in &records {
        assert_eq!(record.system.name, "dubins");
        assert!(record.global.accepted > record.global.draws / 10, "{:?}", record.global);
        assert_eq!(record.growth.outcome, GrowthOutcome::Verified);
        // Both margins are distances less a radius.
        for constant in [&record.constants.target, &record.constants.constraint] {
            assert!((1.0..1.01).contains(&constant.used), "{constant:?}");
        }
    }
    let accepted: Vec<u64> = records.iter().map(|record| record.global.accepted).collect();
    assert!(accepted.iter().all(|count| count.abs_diff(accepted[0]) <= 4), "{accepted:?}");
}

/// At rest in the middle is inside the target, whose half width is 0.25 m; from 0.9 m at 1 m/s outwards
/// nothing stops it before the wall at 1 m.
#[test]
fn measures_tell_who_reaches_the_target() {
    for backend in common::backends() {
        let starts = [[0.0, 0.0], [0.5, 0.0], [0.9, 1.0]];
        let [still, brakes, lost] = measures::measures(&backend, &starts).expect("measures")[..]
        else {
            panic!("one measure per start");
        };
        assert!((still - 0.25).abs() < 1e-6, "{still}");
        assert!(brakes > 0.0 && lost < 0.0, "{brakes}, {lost}");
    }
}

/// The boat's push of at most 1 m/s^2 holds against a small current; against 0.9 it rests 0.9 m aside,
/// where push and current are equal.
#[test]
fn a_text_is_rolled_out_under_each_value_of_its_parameter() {
    for backend in common::backends() {
        let currents = [0.0, 0.1, 0.9];
        let found = given_at_run_time::measures(&backend, &currents).expect("measures");
        assert!(found[0] > 0.1 && found[1] > 0.0, "{found:?}");
        assert!(found[0] > found[1] && found[2] < 0.0, "{found:?}");
    }
}

#[test]
fn a_plan_comes_to_rest_where_it_is_to() {
    for backend in common::backends() {
        let [position, velocity] = plan::steer(&backend, 0.5, 60).expect("plans");
        let far = (position - 0.5).hypot(velocity);
        assert!(far < 0.05, "{}: {position} m at {velocity} m/s", backend.name());
    }
}
