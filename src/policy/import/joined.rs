//! `Concat`: parts of one value put together, each with what was done to its numbers.

use super::draft::Step;
use super::elementwise::{Each, Expression};
use super::front::cut;
use super::map::Map;
use super::parts::{few, rows};
use super::walk::{Number, Problem, Value, Walk};
use crate::policy::onnx::Node;

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
    let all = each.concat();
    few(all.len())?;
    let form = parts[0].form.clone().replaced(axis, &[all.len()]);
    let others = |part: &Number| part.form.clone().replaced(axis, &[all.len()]) == form;
    if !parts.iter().all(others) {
        return Err("of values of different dimensions".into());
    }
    let number = Number { rows: Some(all.clone()), form, ..parts[0].clone() };
    if parts.iter().all(|part| part.expression == number.expression) {
        return Ok(Value::Number(number));
    }
    let maps = parts.iter().zip(&each).map(|(part, rows)| map(&part.expression, rows.len()));
    let maps = maps.collect::<Option<Vec<Map>>>();
    let map = Map::joined(&maps.ok_or("of parts that have gone through different functions")?);
    let plain = Number { expression: Expression::plain(), ..number };
    walk.push(plain, all.len(), Step::Map(map))
}

/// What an expression does to each of `width` numbers, if it is a map.
fn map(expression: &Expression, width: usize) -> Option<Map> {
    let nothing = Map::affine(vec![1.0; width], vec![0.0; width]);
    expression.steps()?.iter().try_fold(nothing, |map, each| {
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
