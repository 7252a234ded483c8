//! The examples do what they say, on every backend.

mod common;

#[path = "../examples/dubins.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod dubins;

use reachcast::scenario::record::GrowthOutcome;

#[test]
fn a_system_of_ones_own_is_certified_on_every_backend() {
    let records: Vec<_> = common::backends()
        .iter()
        .map(|backend| dubins::certificate(backend).expect("certificate"))
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
