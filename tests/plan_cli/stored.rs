//! What of `[plan]` is stored: by plans, and by nothing else.

use std::path::Path;

use reachcast::config::{Config, Overrides};

#[test]
fn certificates_know_nothing_of_plans() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/models/double_integrator.toml");
    let with = |set: &[&str]| {
        let set = set.iter().map(|set| (*set).to_owned()).collect();
        Config::load(&path, &Overrides { set, ..Overrides::default() }).unwrap()
    };
    let (plain, changed) = (with(&[]), with(&["plan.samples=7"]));
    assert_eq!(plain.to_json().unwrap(), changed.to_json().unwrap());
    assert_eq!(plain.to_train_json().unwrap(), changed.to_train_json().unwrap());
    assert!(plain.to_json().unwrap().get("plan").is_none());
    let stored = changed.to_plan_json().unwrap();
    assert_eq!((&stored["plan"]["samples"], &stored["plan"]["horizon"]), (&7.into(), &30.into()));
}
