//! What a certificate says of itself: assumptions, given constants, what was asked beside what was
//! obtained, sets that are empty, bounds that are none, and checks on samples that it has not seen.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::Path;

use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::model::Plant;
use reachcast::model::text::read;
use reachcast::rollout::RolloutSpec;
use reachcast::scenario::record::{Assumption, GrowthOutcome, Record};
use reachcast::scenario::settings::{Joint, Settings};
use reachcast::scenario::{CheckReport, Figure, Unwatched, certify, check};

/// A mass on a line that is driven to the middle, with these margins.
fn line(target: &str, constraint: &str) -> Plant {
    moving("x + 0.1 * u", target, constraint)
}

/// The same with a rule for `x`, beside a clock that starts at 0.
fn moving(x: &str, target: &str, constraint: &str) -> Plant {
    let text = format!(
        "[model]\nname = \"line\"\n\
         [model.states]\nx = {{ box = [-1, 1] }}\nclock = {{ box = [0, 0] }}\n\
         [model.controls]\nu = {{ bounds = [-1, 1] }}\n\
         [model.next]\nx = \"{x}\"\nclock = \"clock + 0.1\"\n\
         [model.task]\nkind = \"reach-avoid\"\ntarget = \"{target}\"\nconstraint = \"{constraint}\"\n\
         [policy]\nformula = {{ u = \"-x\" }}\n"
    );
    let description = read(&text, "line", Path::new("")).unwrap();
    Plant::new(description.model().unwrap(), description.controller().unwrap())
}

fn settings(plant: &Plant) -> Settings {
    let spec = RolloutSpec::new(20, 1.0).unwrap();
    let mut settings = Settings::new(&plant.model, [0.9, 0.0], spec).unwrap();
    settings.global.draws = 2_000;
    // The clock has no side to be drawn along.
    settings.slice = None;
    settings.deviation.radius = 0.02;
    settings.growth.radius = 0.1;
    settings
}

fn certified(plant: &Plant, settings: &Settings) -> Record {
    let backend = Backend::Cpu(Cpu::new(Some(2)).unwrap());
    let program = backend.prepare(plant).unwrap();
    certify(&program, settings, serde_json::Value::Null, &Unwatched).unwrap()
}

fn checked(plant: &Plant, settings: &Settings, record: &Record, seed: u64) -> CheckReport {
    let backend = Backend::Cpu(Cpu::new(Some(2)).unwrap());
    let program = backend.prepare(plant).unwrap();
    check(&program, record, settings, seed, &Unwatched).unwrap()
}

/// Whether a sentence of the record has all of `words`.
fn says(record: &Record, words: &[&str]) -> bool {
    record.statements.iter().any(|said| words.iter().all(|word| said.contains(word)))
}

#[test]
fn a_branch_that_is_assumed_to_be_continuous_is_for_the_user_to_confirm() {
    // The same margin, once as a minimum and once as a branch that nothing is known of.
    let plain = line("0.5 - abs(x)", "2 - max(x, -x)");
    let record = certified(&plain, &settings(&plain));
    assert!(record.holds, "{:?}", record.statements);
    assert_eq!(record.constants.constraint.assumed_continuous, Some(false));
    let branch = line("0.5 - abs(x)", "2 - if(x * x < 0.25, 0.5 * x + 0.25, 2 * x * x)");
    let mut asked = settings(&branch);
    let record = certified(&branch, &asked);
    let constant = &record.constants.constraint;
    assert_eq!(constant.assumed_continuous, Some(true));
    assert!(says(&record, &["constraint margin", "could not be shown", "constants.assume"]));
    assert!(!record.holds, "{:?}", record.statements);
    asked.constants.assume = vec![Assumption::Continuous];
    let confirmed = certified(&branch, &asked);
    assert!(says(&confirmed, &["constraint margin", "confirmed by the user"]));
    // This one jumps at -0.5, and a slope across the jump proves that the constant is none.
    assert_eq!(confirmed.holds, !confirmed.constants.constraint.is_refuted());
}

#[test]
fn given_constants_are_held_against_samples() {
    let plant = line("0.5 - 2 * abs(x)", "2 - abs(x)");
    let given = |target: f64| {
        let mut asked = settings(&plant);
        (asked.constants.target, asked.constants.constraint) = (Some(target), Some(1.0));
        certified(&plant, &asked)
    };
    let right = given(2.0);
    assert!(right.holds && !says(&right, &["constant"]), "{:?}", right.statements);
    let wrong = given(1.9);
    assert!(wrong.constants.target.is_refuted() && !wrong.holds);
    assert!(says(&wrong, &["target margin is wrong", "1.9", "1.999"]), "{:?}", wrong.statements);
    // A corner that samples do not find: below the bound, above every sample.
    let corner = line("0.5 - abs(x) - max(0, 500 * (x - 0.99999))", "2 - abs(x)");
    let mut asked = settings(&corner);
    asked.constants.target = Some(501.0 - 1e-3);
    asked.constants.region = reachcast::scenario::settings::ConstantRegion::Box;
    let record = certified(&corner, &asked);
    assert!(says(&record, &["CAUTION", "is below the computed bound"]), "{:?}", record.statements);
}

#[test]
fn a_margin_that_does_not_change_has_the_constant_0() {
    let plant = line("0.5 - abs(x)", "1");
    let mut asked = settings(&plant);
    let computed = certified(&plant, &asked);
    assert_eq!(computed.constants.constraint.used, 0.0);
    asked.constants.constraint = Some(0.0);
    assert!(certified(&plant, &asked).holds && computed.holds);
}

#[test]
fn a_claim_has_what_was_asked_and_what_was_obtained() {
    let plant = line("0.5 - abs(x)", "2 - abs(x)");
    let record = certified(&plant, &settings(&plant));
    let claim = &record.global.claim;
    assert_eq!(claim.epsilon, Some(0.1));
    assert!(claim.certified_risk < 0.02, "{}", claim.certified_risk);
    let document = serde_json::to_value(&record).unwrap();
    assert_eq!(document["global"]["claim"]["epsilon"], 0.1);
    let read: Record = serde_json::from_value(document).unwrap();
    assert_eq!(read.global.claim, *claim);
}

#[test]
fn every_certified_pair_is_run_in_f64() {
    let plant = line("0.5 - abs(x)", "2 - abs(x)");
    let record = certified(&plant, &settings(&plant));
    assert!(record.global.accepted > 500);
    assert!(record.global.f64_reruns >= record.global.accepted, "{:?}", record.global.f64_reruns);
}

#[test]
fn constants_hold_where_the_rollouts_go() {
    // The slope grows with the clock, which the box of starts has at 0: 1 there, 3 after 20 steps.
    let plant = line("0.5 - (1 + clock) * abs(x)", "2 - abs(x)");
    let mut asked = settings(&plant);
    let record = certified(&plant, &asked);
    let region = record.constants.region.as_ref().unwrap();
    assert!(region.high[1] > 2.0 && region.low[1] < 0.0, "{region:?}");
    assert!(record.constants.target.used >= 3.0, "{:?}", record.constants.target);
    asked.constants.region = reachcast::scenario::settings::ConstantRegion::Box;
    let over_the_box = certified(&plant, &asked);
    assert!(over_the_box.constants.target.used < 2.0, "{:?}", over_the_box.constants.target);
}

#[test]
fn an_empty_set_says_why() {
    let plant = line("0.05 - abs(x)", "2 - abs(x)");
    let mut asked = settings(&plant);
    asked.deviation.radius = 0.9;
    let record = certified(&plant, &asked);
    assert_eq!(record.global.accepted, 0);
    let all = record.statements.join("\n");
    assert!(!all.contains("0 of 0") && !all.contains("at most 1"), "{all}");
    for words in [
        "No claim is made about rollouts from the certified set",
        "the largest distance seen",
        "is anything left of the target margin",
        "was set at step",
        "deviation.radius",
    ] {
        assert!(all.contains(words), "no `{words}` in {all}");
    }
    assert!(!record.holds);
}

#[test]
fn a_bound_that_is_none_claims_nothing() {
    let plant = moving("x + 0.1 * u + log(0.9 - abs(x))", "0.5 - abs(x)", "2 - abs(x)");
    let mut asked = settings(&plant);
    (asked.constants.target, asked.constants.constraint) = (Some(1.0), Some(1.0));
    let record = certified(&plant, &asked);
    assert!(record.deviation.non_finite > 0 && !record.holds);
    assert!(record.deviation.claim.statement.starts_with("The deviation bound is none"));
    assert!(!record.statements.iter().any(|said| said.contains("stays within")));
}

#[test]
fn a_plant_that_amplifies_its_last_digits_is_told() {
    let plain = line("0.5 - abs(x)", "2 - abs(x)");
    let record = certified(&plain, &settings(&plain));
    assert_eq!(record.global.f32_apart, Some(0));
    // What is added is drawn from the digits of the state.
    let noisy = "x + 0.1 * u + 0.05 * sin(1e6 * x)";
    let plant = moving(noisy, "0.5 - abs(x)", "2 - abs(x)");
    let record = certified(&plant, &settings(&plant));
    assert!(record.global.f32_apart > Some(64), "{:?}", record.global.f32_apart);
    assert!(says(&record, &["CAUTION", "pseudo-random"]), "{:?}", record.statements);
}

#[test]
fn bounds_of_single_steps_are_so_many_claims() {
    let plant = line("0.5 - abs(x)", "2 - abs(x)");
    let mut asked = settings(&plant);
    let joint = certified(&plant, &asked);
    asked.deviation.joint = Joint::Separate;
    let record = certified(&plant, &asked);
    let of =
        |record: &Record| record.ledger.iter().find(|line| line.claim == "deviation").unwrap().beta;
    assert_eq!(of(&joint), 1e-3);
    assert!((of(&record) - 20e-3).abs() < 1e-15, "{:?}", record.ledger);
    assert!((record.beta_total - joint.beta_total - 19e-3).abs() < 1e-12);
    assert!(says(
        &record,
        &["1 - 0.001 for each step", "1 - 0.02 for all 20", "no joint statement"]
    ));
}

#[test]
fn a_centre_at_the_side_of_the_box_is_told() {
    // Everything is certified: the only boundary is the side of the box.
    let plant = line("0.9 - abs(x)", "2 - abs(x)");
    let mut asked = settings(&plant);
    asked.growth.varies = vec![true, false];
    let record = certified(&plant, &asked);
    assert!(record.growth.outcome != GrowthOutcome::NoBoundary);
    assert!(says(&record, &["lies at the end of the box (x ="]), "{:?}", record.statements);
    // A set that ends within the box.
    let plant = line("0.5 - abs(x)", "0.7 - abs(x)");
    let inner = certified(&plant, &Settings { growth: asked.growth.clone(), ..settings(&plant) });
    assert!(!says(&inner, &["lies at the end of the box"]), "{:?}", inner.statements);
}

/// The finding of this name, and whether it stands.
fn finding(report: &CheckReport, name: &str) -> (Figure, bool) {
    let found = report.findings.iter().find(|finding| finding.name.contains(name));
    let found = found.unwrap_or_else(|| panic!("no `{name}` in {report:?}"));
    (found.found.clone(), found.holds)
}

#[test]
fn a_check_draws_what_nobody_has_seen() {
    let plant = line("0.5 - abs(x)", "0.7 - abs(x)");
    let asked = settings(&plant);
    let record = certified(&plant, &asked);
    let [one, again, other] = [1, 1, 2].map(|seed| checked(&plant, &asked, &record, seed));
    assert!(one.holds && other.holds, "{one:?} {other:?}");
    assert_eq!(one, again);
    let name = "certified share on fresh pairs";
    assert_ne!(finding(&one, name), finding(&other, name));
    assert_eq!((one.fresh_seed, other.fresh_seed), (1, 2));
    // A bound that holds for the pairs that made it and for few others.
    let mut forged = record.clone();
    forged.deviation.bound.iter_mut().for_each(|bound| *bound *= 0.5);
    let report = checked(&plant, &asked, &forged, 3);
    assert!(!finding(&report, "fresh pairs beyond the deviation bound").1, "{report:?}");
}

/// Intervals of the share that miss it with probability 0.3 each: chance is not what refutes them.
#[test]
fn a_check_refuses_no_true_share() {
    let plant = line("0.5 - abs(x)", "0.7 - abs(x)");
    let mut asked = settings(&plant);
    (asked.global.beta, asked.global.draws) = (0.3, 1_000);
    (asked.growth.rounds, asked.growth.scenarios) = (1, 159);
    for seed in 1..=60 {
        asked.seed = seed;
        let record = certified(&plant, &asked);
        let report = checked(&plant, &asked, &record, 1_000 + seed);
        assert!(finding(&report, "certified share on fresh pairs").1, "seed {seed}: {report:?}");
        assert!(report.holds, "seed {seed}: {report:?}");
    }
    // One that is far from true is still refused.
    let mut forged = certified(&plant, &asked);
    forged.global.share_interval = [0.95, 0.99];
    let report = checked(&plant, &asked, &forged, 5);
    assert!(!finding(&report, "certified share on fresh pairs").1, "{report:?}");
}
