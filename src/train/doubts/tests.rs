//! Doubts about runs that learned nothing, little, or were still learning; none about others.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use super::*;
use crate::scenario::record::Provenance;
use crate::train::record::{CurvePoint, Origin, TRAIN_SCHEMA};

/// A run of `method` whose share of successes was `shares` at each score, 10 iterations apart, `best` the one kept.
fn record(method: Method, shares: &[f64], best: usize) -> TrainRecord {
    let word = || "-".to_owned();
    let provenance = Provenance {
        version: word(),
        seed: 1,
        generator: word(),
        config: serde_json::json!({}),
        policy: word(),
        policy_sha256: word(),
        physics_sha256: word(),
        backend: word(),
        device: word(),
        networks: None,
    };
    let point = |(i, share): (usize, &f64)| CurvePoint {
        iteration: 10 * i as u64,
        loss: None,
        scores: vec![*share],
    };
    TrainRecord {
        schema: TRAIN_SCHEMA,
        origin: Origin { method, provenance },
        total: 10 * (shares.len() - 1) as u64,
        stopped_early: false,
        best: 10 * best as u64,
        scores: vec![word()],
        curve: shares.iter().enumerate().map(point).collect(),
        networks: Vec::new(),
        policy: None,
        notes: Vec::new(),
        events: Vec::new(),
    }
}

/// Whether the doubts about a run are one each that begins with these words.
fn begins(record: &TrainRecord, words: &[&str]) -> bool {
    let found = doubts(record);
    found.len() == words.len()
        && found.iter().zip(words).all(|(found, word)| found.starts_with(word))
}

#[test]
fn a_policy_that_learned_nothing_is_doubted_with_another_method() {
    let unchanged = record(Method::Analytic, &[0.0, 0.0, 0.0], 0);
    assert!(begins(&unchanged, &["no score was better"]));
    assert!(doubts(&unchanged)[0].contains("train.method=ppo"));
    let hardly = record(Method::Ppo, &[0.0, 0.0034, 0.0], 1);
    assert!(begins(&hardly, &["fewer than 5 %"]));
    assert!(doubts(&hardly)[0].contains("train.method=analytic"));
    assert!(doubts(&hardly)[0].contains("another `--seed`"));
}

#[test]
fn a_run_that_ends_on_its_best_score_may_go_on() {
    assert!(begins(&record(Method::Ppo, &[0.0, 0.2, 0.6], 2), &["the last score is the best"]));
    assert!(begins(&record(Method::Ppo, &[0.0, 0.6, 0.2], 1), &[]));
    assert!(begins(&record(Method::Ppo, &[0.0, 0.2, 0.96], 2), &[]));
}

#[test]
fn what_was_good_from_the_start_and_what_is_no_policy_are_not_doubted() {
    assert!(begins(&record(Method::Analytic, &[1.0, 1.0], 0), &[]));
    assert!(begins(&record(Method::Value, &[0.0, 0.0], 0), &[]));
    assert!(begins(&record(Method::Ppo, &[0.0], 0), &[]));
}
