//! Operations of a graph that give the numbers of a value other dimensions: `Reshape`, `Transpose` and the like.

use super::walk::{Number, Problem, Value, constant};
use crate::policy::onnx::Node;

/// The value with the dimensions that `node` gives it.
///
/// # Errors
/// A sentence about an operation that would put numbers of several inputs together, or in another order.
pub(super) fn apply(node: &Node, number: Number, rest: &[Option<Value>]) -> Result<Value, Problem> {
    let Number { form, .. } = &number;
    let before = form.to_string();
    let form = form.clone();
    let found = match node.operation.as_str() {
        "Flatten" => form.flattened(node.integer("axis").unwrap_or(1)),
        "Transpose" => form.transposed(node.integers("perm")),
        "Reshape" if node.integer("allowzero").unwrap_or(0) != 0 => None,
        "Reshape" => form.reshaped(&lengths(node, rest)?),
        "Unsqueeze" => form.unsqueezed(&axes(node, rest)?.ok_or("without axes")?),
        _ => form.squeezed(axes(node, rest)?.as_deref()),
    };
    let form = found.ok_or_else(|| {
        format!("of a value {before}, after which the numbers of each input do not lie as before")
    })?;
    Ok(Value::Number(Number { form, ..number }))
}

/// The lengths that a `Reshape` asks for.
fn lengths(node: &Node, rest: &[Option<Value>]) -> Result<Vec<f64>, Problem> {
    match (rest.first(), node.integers("shape")) {
        (Some(Some(Value::Sizes)), _) => Err("to lengths that the graph does not say".into()),
        (None, Some(stated)) => Ok(stated.iter().map(|&length| length as f64).collect()),
        _ => Ok(constant(rest, 0)?.numbers.clone()),
    }
}

/// The axes of a `Squeeze` or `Unsqueeze`, as an input or as an attribute.
fn axes(node: &Node, rest: &[Option<Value>]) -> Result<Option<Vec<i64>>, Problem> {
    match rest.first() {
        Some(Some(_)) => Ok(Some(constant(rest, 0)?.wholes())),
        _ => Ok(node.integers("axes").map(<[i64]>::to_vec)),
    }
}
