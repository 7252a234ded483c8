//! Networks inside formulas on the CPU: against f64, what they hash to, and what is no number in them.

use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::formula::Node;
use reachcast::rollout::{NON_FINITE, PairControl, Query};
use reachcast::scenario::lipschitz::{MarginBox, margins, sampled};

use super::learned::batches::{assert_measures, assert_mutants_are_seen, assert_pairs, values};
use super::learned::{LAWS, Law, Truth, plant, plant_of};

/// The processor with each instruction set that it has.
fn each() -> Vec<Backend> {
    Cpu::each(Some(2)).expect("a processor").into_iter().map(Backend::Cpu).collect()
}

/// The graphs in f64, one state at a time: what the oracle computes.
#[test]
fn one_state_at_a_time() {
    for law in LAWS {
        let (plant, truth) = (plant(law), Truth::new(law));
        for (i, x) in [[0.3, -0.8], [-1.2, 0.4], [0.0, 1.1]].into_iter().enumerate() {
            let step = 7 * i as u32;
            let force = truth.force(x, step);
            assert!((plant.control(&x, step)[0] - force).abs() < 1e-12, "{law:?}");
            let (found, next) = (plant.model.next(&x, &[force], step), truth.next(x, force, step));
            // Lengths such as a sixth of the period are f32.
            assert!((0..2).all(|i| (found[i] - next[i]).abs() < 1e-7), "{found:?}, not {next:?}");
            let [target, constraint] = truth.margins(x, step);
            assert!((plant.model.target_at(&x, step) - target).abs() < 1e-12);
            assert!((plant.model.constraint_at(&x, step) - constraint).abs() < 1e-7);
        }
    }
}

/// A network is one call for all its outputs: two at each of the eight stages of a step, and no more.
#[test]
fn a_network_is_called_once_a_stage() {
    let step = &plant(Law::Formula).model.step;
    assert_eq!(step.calls.len(), 2 * 8);
    let said = step.nodes.iter().filter(|node| matches!(node, Node::Said(..))).count();
    assert_eq!(said, 3 * 8);
    assert!(step.nodes.len() < 300, "{} nodes: not unrolled", step.nodes.len());
}

#[test]
fn measures_and_signs() {
    for backend in each() {
        LAWS.into_iter().for_each(|law| assert_measures(&backend, law));
    }
}

#[test]
fn pairs() {
    for backend in each() {
        for law in LAWS {
            for control in [PairControl::Replay, PairControl::ClosedLoop] {
                assert_pairs(&backend, law, control);
            }
        }
    }
}

#[test]
fn mutants_are_seen() {
    assert_mutants_are_seen(&each()[0]);
}

/// What is no number in a network is none behind it: the rollout fails, whatever the activation and
/// whatever chooses.
#[test]
fn a_nan_in_a_network_fails_the_rollout() {
    for file in ["drag", "inside"] {
        // The logarithm is no number left of -2, where no start is, but each gets there.
        let text = Law::Formula
            .cart()
            .replacen(
                "'inside.safetensors', x, v)[0] - 0.1",
                &format!("'{file}.safetensors', log(0.5 - t), v)[0] - 9"),
                1,
            )
            .replacen("1.4 - abs(x)", "9", 1);
        for backend in each() {
            let found = values(&backend, &plant_of(&text), Query::Measure);
            assert!(found.iter().all(|value| *value == NON_FINITE), "{file}: {found:?}");
        }
    }
}

/// The hash tells networks apart by each of their weights.
#[test]
fn a_weight_is_part_of_the_hash() {
    let text = |edit: fn(&mut f32)| {
        let folder = tempfile::tempdir().expect("a folder");
        super::learned::write(folder.path());
        let path = folder.path().join("drag.safetensors");
        let mut bytes = std::fs::read(&path).expect("the file");
        let at = bytes.len() - 4;
        let mut last = f32::from_le_bytes(bytes[at..].try_into().expect("four bytes"));
        edit(&mut last);
        bytes[at..].copy_from_slice(&last.to_le_bytes());
        std::fs::write(&path, bytes).expect("the file");
        let cart = Law::Formula.cart();
        let described = reachcast::model::text::read(&cart, "cart.toml", folder.path());
        let described = described.expect("a description");
        let (model, policy) = (described.model(), described.controller());
        let (model, policy) = (model.expect("a model"), policy.expect("a policy"));
        reachcast::model::Plant::new(model, policy).text()
    };
    assert_eq!(text(|_| {}), text(|_| {}));
    assert_ne!(text(|_| {}), text(|last| *last = last.next_up()));
}

/// Constants of learned margins hold every sampled slope, and over a small box they are no more than
/// the slopes there are.
#[test]
fn constants_of_learned_margins() {
    let model = &plant(Law::Formula).model;
    for (half, share) in [(1.0, 0.0), (1e-3, 0.9)] {
        for [x, v] in [[0.0, 0.0], [0.4, -0.7], [-0.9, 0.2]] {
            let (low, high) = ([x - half, v - half], [x + half, v + half]);
            let region = MarginBox { low: &low, high: &high, varies: &[true; 2], horizon: 0 };
            let (found, slopes) = (margins(model, region), sampled(model, region, 500, 1));
            for (found, slope) in
                [(found.target, slopes.target), (found.constraint, slopes.constraint)]
            {
                // A slope over 2e-5 between margins of a few units is rounded at 1e-10.
                assert!(slope <= found.constant + 1e-9, "{slope} of {found:?}");
                assert!(slope >= share * found.constant, "{slope} of {found:?}");
                assert!(found.constant.is_finite() && !found.assumed_continuous, "{found:?}");
            }
        }
    }
}
