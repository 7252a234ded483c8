//! The formulas of each file, one state at a time in f64; and that no formula could be another.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::model::Plant;
use toml::{Table, Value};

use super::poles::with_friction;
use super::truth::Truth;
use super::{all, network, plant, wide};

/// Largest distance of a value of the text from that of the mathematics, relative to 1 or to itself: literals
/// of a text are f32, and so is a sixth of a period, which is 6e-8 each.
const CLOSE: f64 = 1e-5;
/// The same of a control, relative to its bound: 2 cm from the dock, its direction is as far off as 5e-6, and wheels
/// turn by ten times that.
const STEERED: f64 = 1e-4;

/// States near those that rollouts visit, with the number of their step.
fn visited(truth: &Truth, plant: &Plant) -> Vec<(Vec<f64>, usize)> {
    let mut random = StdRng::seed_from_u64(9);
    let mut all = Vec::new();
    for start in truth.starts(plant, 24, 1.3) {
        for (step, mut x) in truth.states(&wide(&start), truth.horizon()).into_iter().enumerate() {
            for (x, axis) in x.iter_mut().zip(&plant.model.states) {
                *x += 0.1 * f64::from(axis.high - axis.low) * random.random_range(-1.0..1.0);
            }
            all.push((x, step));
        }
    }
    all
}

/// Requires `found` to be `wanted` up to `most`, relative to 1 or to itself.
fn close([found, wanted]: [f64; 2], most: f64, about: &str) -> Result<(), String> {
    let near = found == wanted || (found - wanted).abs() <= most * wanted.abs().max(1.0);
    near.then_some(()).ok_or_else(|| format!("{about}: {found}, not {wanted}"))
}

/// Whether the formulas of `plant` are `truth` at a state.
fn agrees_at(truth: &Truth, plant: &Plant, x: &[f64], step: usize) -> Result<(), String> {
    let (t, number) = (truth.time(step), step as u32);
    let about = |what: &str| format!("{}: {what} at {x:?}, step {step}", truth.file);
    let u = (truth.policy)(x, t);
    let controls = plant.control(x, number).into_iter().zip(&u);
    for ((found, wanted), [_, high]) in controls.zip(&truth.bounds) {
        let scale = high.max(1.0);
        close([found / scale, wanted / scale], STEERED, &about("control"))?;
    }
    let constraints = [plant.model.constraint_at(x, number), (truth.constraint)(x, t)];
    close(constraints, CLOSE, &about("constraint"))?;
    close([plant.model.target_at(x, number), (truth.target)(x, t)], CLOSE, &about("target"))?;
    // With controls of its own, some beyond their bounds.
    let mut random = StdRng::seed_from_u64(step as u64);
    let mut draw = |[low, high]: [f64; 2]| random.random_range(1.2 * low - 0.3..1.2 * high + 0.3);
    let drawn = truth.bounds.iter().map(|bounds| draw(*bounds)).collect::<Vec<f64>>();
    for u in [&u, &drawn] {
        let found = plant.model.next(x, u, number);
        for (found, wanted) in found.into_iter().zip(truth.next(x, u)) {
            close([found, wanted], CLOSE, &about("next"))?;
        }
    }
    Ok(())
}

fn agrees(truth: &Truth, plant: &Plant, states: &[(Vec<f64>, usize)]) -> Result<(), String> {
    states.iter().try_for_each(|(x, step)| agrees_at(truth, plant, x, *step))
}

#[test]
fn formulas_are_their_mathematics() {
    for truth in all() {
        let plant = truth.plant();
        assert_eq!(plant.model.period, Some(truth.period), "{}", truth.file);
        let states = visited(&truth, &plant);
        agrees(&truth, &plant, &states).unwrap_or_else(|problem| panic!("{problem}"));
    }
}

/// A table of `text` by the names that lead to it.
fn table<'t>(text: &'t mut Table, path: &[&str]) -> Option<&'t mut Table> {
    path.iter().try_fold(text, |table, key| table.get_mut(*key)?.as_table_mut())
}

/// The texts of `file` with one formula or one number in it changed by a hundredth, each with what was changed.
pub(crate) fn mutants(text: &str) -> Vec<(String, String)> {
    const SECTIONS: [&[&str]; 6] = [
        &["model", "let"],
        &["model", "flow"],
        &["model", "next"],
        &["model", "task"],
        &["model", "parameters"],
        &["policy", "formula"],
    ];
    let parsed: Table = text.parse().expect("a table");
    let mut all = Vec::new();
    for path in SECTIONS {
        let keys: Option<Vec<String>> =
            table(&mut parsed.clone(), path).map(|table| table.keys().cloned().collect());
        for key in keys.unwrap_or_default() {
            let mut changed = parsed.clone();
            let entry = table(&mut changed, path).and_then(|table| table.get_mut(&key));
            if entry.is_some_and(mutate) {
                all.push((format!("{}.{key}", path.join(".")), changed.to_string()));
            }
        }
    }
    all
}

/// Changes a formula or the value of a parameter; whether it is one.
fn mutate(value: &mut Value) -> bool {
    match value {
        Value::String(formula) => {
            *formula = format!("1.01 * ({formula}) + 0.001");
            true
        }
        Value::Table(parameter) => {
            let value = parameter.get("value").and_then(Value::as_float).expect("a value");
            parameter.insert("value".to_owned(), Value::Float(1.01 * value));
            true
        }
        _ => false,
    }
}

/// Each formula and each parameter of each file is held by the mathematics: changed a little, it is seen.
#[test]
fn a_changed_formula_is_seen() {
    for truth in all() {
        let states = visited(&truth, &truth.plant());
        let mut count = 0;
        for (name, text) in mutants(&truth.text()) {
            // What is no formula, such as the kind of a task, is refused.
            let Ok(mutant) = plant(&text) else { continue };
            count += 1;
            let seen = agrees(&truth, &mutant, &states).is_err();
            assert!(seen, "{}: a change of {name} is not seen", truth.file);
        }
        assert!(count >= 4, "{}: {count} mutants", truth.file);
    }
}

/// The network says what the comment on it says, against another rule in short steps.
#[test]
fn the_learned_pendulum_is_one_with_friction() {
    let network = network::network("models/learned_pendulum.safetensors");
    let mut random = StdRng::seed_from_u64(3);
    let mut squares = [0.0; 2];
    let count = 1000;
    for _ in 0..count {
        let mut draw = |most: f64| random.random_range(-most..most);
        let (x, torque) = ([draw(3.0), draw(9.0)], draw(2.0));
        let grown = network(&[x[0].sin(), x[0].cos(), x[1], torque]);
        let next = with_friction(x, torque);
        let errors = [0, 1].map(|i| x[i] + grown[i] - next[i]);
        assert!(
            errors[0].abs() <= 1e-3 && errors[1].abs() <= 9.7e-3,
            "{x:?}, {torque}: {errors:?}"
        );
        (0..2).for_each(|i| squares[i] += errors[i].powi(2));
    }
    let [angle, rate] = squares.map(|sum| (sum / f64::from(count)).sqrt());
    // The largest ones weigh much among few: a tenth more than over all.
    assert!(angle <= 1.2e-4 && rate <= 8.2e-4, "{angle}, {rate}");
}
