//! Parts of what a network gives: `Split`, `Slice`, `Gather` and `GatherND`.

use super::walk::{Number, Problem, Value, Walk, constant};
use crate::policy::onnx::Node;

/// Most numbers of a part.
const MOST: usize = 1 << 12;

/// What these operations give.
///
/// # Errors
/// A part of something else than the last dimension, or one that is not there.
pub(super) fn apply(
    walk: &Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Vec<Value>, Problem> {
    let axis = axis(node, &number, rest)?;
    number.form.along(axis)?;
    let all = rows(walk, &number)?;
    let unknown = |value: &Option<Value>| match value {
        Some(Value::Constant(array)) => array.numbers.iter().any(|number| number.is_nan()),
        Some(_) => true,
        None => false,
    };
    if rest.iter().any(unknown) {
        return Err("whose ends are not known: they depend on the input, or count inputs".into());
    }
    let wholes = |i: usize, name: &str| match rest.get(i) {
        Some(Some(Value::Constant(array))) => Some(array.wholes()),
        _ => node.integers(name).map(<[i64]>::to_vec),
    };
    let parts = match node.operation.as_str() {
        "Split" => split(&all, wholes(0, "split"), node.outputs.len()),
        "Slice" => {
            let steps = wholes(3, "steps").unwrap_or_default();
            let one = |all: Option<Vec<i64>>| all.filter(|all| all.len() == 1).map(|all| all[0]);
            let ends = one(wholes(0, "starts")).zip(one(wholes(1, "ends"))).map(<[i64; 2]>::from);
            let step = if steps.is_empty() { Some(1) } else { one(Some(steps)) };
            ends.zip(step).map(|(ends, step)| vec![slice(&all, ends, step)])
        }
        _ => {
            let picks = constant(rest, 0)?.wholes();
            few(picks.len())?;
            let pick = |&i: &i64| all.get(place(i, all.len())?).copied();
            let picked = picks.iter().map(pick).collect::<Option<Vec<usize>>>();
            picked.map(|rows| vec![rows])
        }
    };
    let parts = parts.filter(|parts| parts.iter().all(|rows| !rows.is_empty()));
    let parts = parts.ok_or("a part that is not there")?;
    let picked = match node.operation.as_str() {
        "Gather" => Some(constant(rest, 0)?.shape.clone()),
        // Each index is a list of one.
        "GatherND" => constant(rest, 0)?.shape.split_last().map(|(_, shape)| shape.to_vec()),
        _ => None,
    };
    let part = |rows: Vec<usize>| {
        let lengths = picked.clone().unwrap_or_else(|| vec![rows.len()]);
        let form = number.form.clone().replaced(axis, &lengths);
        Value::Number(Number { rows: Some(rows), form, ..number.clone() })
    };
    Ok(parts.into_iter().map(part).collect())
}

/// Which numbers of what the network gives a value has.
///
/// # Errors
/// Those of an input of unknown width, or of more than [`MOST`] numbers.
pub(super) fn rows(walk: &Walk, number: &Number) -> Result<Vec<usize>, Problem> {
    if let Some(rows) = &number.rows {
        return Ok(rows.clone());
    }
    let width = walk.draft.width().ok_or("of an input of unknown width")?;
    few(width)?;
    Ok((0..width).collect())
}

/// The dimension of which a part is taken.
fn axis(node: &Node, number: &Number, rest: &[Option<Value>]) -> Result<usize, Problem> {
    let axis = match (node.operation.as_str(), rest.get(2)) {
        ("Slice", Some(Some(Value::Constant(axes)))) => one(&axes.wholes()),
        ("Slice", _) => node.integers("axes").and_then(one),
        ("GatherND", _) => {
            let lists = constant(rest, 0)?.shape.last() == Some(&1);
            (lists && node.integer("batch_dims").unwrap_or(0) == 0).then_some(0)
        }
        _ => Some(node.integer("axis").unwrap_or(0)),
    };
    Ok(number.form.axis(axis.ok_or("not of one axis")?)?)
}

/// The only one of them.
fn one(all: &[i64]) -> Option<i64> {
    if let [one] = all { Some(*one) } else { None }
}

/// Refuses a part of more than [`MOST`] numbers.
pub(super) fn few(count: usize) -> Result<(), Problem> {
    match count <= MOST {
        true => Ok(()),
        false => Err(format!("with a part of {count} numbers; at most {MOST} are taken").into()),
    }
}

/// The index that `i` stands for, which counts from the end if it is negative.
fn place(i: i64, width: usize) -> Option<usize> {
    usize::try_from(if i < 0 { i + width as i64 } else { i }).ok()
}

/// So many parts: of these lengths, or as long as each other.
fn split(all: &[usize], lengths: Option<Vec<i64>>, count: usize) -> Option<Vec<Vec<usize>>> {
    let each = all.len().div_ceil(count.max(1));
    let lengths = lengths.unwrap_or_else(|| vec![each as i64; count]);
    let mut rest = all;
    let part = |length: i64| {
        let length = usize::try_from(length).ok()?.min(rest.len());
        let (part, after) = rest.split_at(length);
        rest = after;
        Some(part.to_vec())
    };
    let parts = lengths.into_iter().map(part).collect::<Option<Vec<_>>>();
    parts.filter(|_| rest.is_empty())
}

/// From the first of `ends` up to the second, as far as there is something, by steps of either sign.
fn slice(all: &[usize], [start, end]: [i64; 2], step: i64) -> Vec<usize> {
    let width = all.len() as i64;
    let from_start = |i: i64| if i < 0 { i.saturating_add(width) } else { i };
    let (lowest, highest) = if step > 0 { (0, width) } else { (-1, width - 1) };
    let [start, end] = [start, end].map(|i| from_start(i).clamp(lowest, highest));
    let count = match step {
        0 => 0,
        _ => {
            let (apart, step) = (i128::from(end - start), i128::from(step));
            ((apart + step - step.signum()) / step) as i64
        }
    };
    let at = |k: i64| all.get(usize::try_from(start + k.saturating_mul(step)).ok()?).copied();
    (0..count.max(0)).map_while(at).collect()
}
