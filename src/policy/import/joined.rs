//! `Concat`: parts of one value put together, each with what was done to its numbers.

use super::draft::Step;
use super::elementwise::{Each, Expression};
use super::front::cut;
use super::map::Map;
use super::parts::{few, rows};
use super::walk::{Number, Problem, Value, Walk};
use crate::policy::onnx::Node;

/// Why parts that are no maps of the same are refused.
const DIFFERENT: &str = "of parts that have gone through different functions";

/// What it gives of `number` and the others.
///
/// # Errors
/// Constants, values whose numbers do not lie in one dimension, or of different functions.
pub(super) fn apply(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: Vec<Option<Value>>,
) -> Result<Value, Problem> {
    let mut parts = vec![number];
    for value in rest {
        match value {
            Some(Value::Number(number)) => parts.push(number),
            _ => return Err("of a value and a constant, or one that is missing".into()),
        }
    }
    let axis = parts[0].form.axis(node.integer("axis").ok_or("without an axis")?)?;
    parts.iter().try_for_each(|part| part.form.along(axis))?;
    let each = parts.iter().map(|part| rows(walk, part)).collect::<Result<Vec<_>, Problem>>()?;
    few(each.iter().map(Vec::len).sum())?;
    let all = each.concat();
    let form = parts[0].form.clone().replaced(axis, &[all.len()]);
    let others = |part: &Number| part.form.clone().replaced(axis, &[all.len()]) == form;
    if !parts.iter().all(others) {
        return Err("of values of different dimensions".into());
    }
    let number = Number { rows: Some(all.clone()), form, ..parts[0].clone() };
    if parts.iter().all(|part| part.expression == number.expression) {
        return Ok(Value::Number(number));
    }
    // What all of them went through, and then each by itself.
    let shared = shared(&parts).ok_or(DIFFERENT)?;
    let maps = parts.iter().zip(&each).map(|(part, rows)| map(part, shared.len(), rows.len()));
    let map = Map::joined(&maps.collect::<Option<Vec<Map>>>().ok_or(DIFFERENT)?);
    let expression = shared.iter().fold(Expression::plain(), |all, each| all.then(*each));
    walk.push(Number { expression, ..number }, all.len(), Step::Map(map))
}

/// What all parts go through first; none if one is no row of operations.
fn shared(parts: &[Number]) -> Option<Vec<Each>> {
    let mut all = parts.iter().map(|part| part.expression.steps());
    let first = all.next()??.to_vec();
    all.try_fold(first, |mut shared, steps| {
        let same = shared.iter().zip(steps?).take_while(|(a, b)| a == b).count();
        shared.truncate(same);
        Some(shared)
    })
}

/// What a part does to each of its `width` numbers behind the first operations, if it is a map.
fn map(part: &Number, first: usize, width: usize) -> Option<Map> {
    part.expression.steps()?[first..].iter().try_fold(Map::nothing(width), |map, each| {
        let next = match each {
            Each::Activation(activation) => cut(*activation, width)?,
            each => match each.step(width) {
                Step::Map(next) => next,
                _ => return None,
            },
        };
        Some(map.then(&next))
    })
}
