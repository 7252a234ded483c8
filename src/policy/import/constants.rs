//! What operations of a graph make of constants, before anything runs.

use super::array::Array;
use super::kind::Cast;
use crate::policy::onnx::Node;

/// Kinds of numbers that a cast may lead to.
pub(super) const FLOATS: [i64; 2] = [1, 11];
const INTEGERS: [i64; 2] = [6, 7];

/// What the operation `node` gives for constants; `None` for an input that is left out.
///
/// # Errors
/// A sentence about an operation that is not known, or shapes that do not go together.
pub(super) fn folded(node: &Node, inputs: &[Option<&Array>], cast: Cast) -> Result<Array, String> {
    if node.operation == "Constant" {
        return node.constant(cast).map_err(|problem| format!("`{}`: {problem}", name(node)));
    }
    let input = |i: usize| inputs.get(i).copied().flatten();
    let first = input(0).ok_or("an input is missing")?;
    let found = match (node.operation.as_str(), input(1)) {
        ("Identity" | "Dropout", _) => Some(first.clone()),
        ("Cast", _) => Some(as_kind(first, node.integer("to").unwrap_or_default())?),
        ("Add", Some(other)) => first.with(other, |a, b| a + b),
        ("Sub", Some(other)) => first.with(other, |a, b| a - b),
        ("Mul", Some(other)) => first.with(other, |a, b| a * b),
        ("Div", Some(other)) if first.whole && other.whole && other.numbers.contains(&0.0) => {
            return Err("of integers by 0".to_owned());
        }
        // Towards 0, as ONNX has it.
        ("Div", Some(other)) if first.whole && other.whole => {
            first.with(other, |a, b| (a / b).trunc())
        }
        ("Div", Some(other)) => first.with(other, |a, b| a / b),
        ("Pow", Some(other)) => first.with(other, f64::powf),
        ("Max", _) => every(inputs, f64::max),
        ("Min", _) => every(inputs, f64::min),
        ("Neg", None) => Some(first.each(|x| -x)),
        ("Sqrt", None) => Some(first.each(f64::sqrt)),
        ("Exp", None) => Some(first.each(f64::exp)),
        ("Reciprocal", None) => Some(first.each(|x| 1.0 / x)),
        ("Reshape", Some(shape)) if shape.numbers.iter().any(|length| length.is_nan()) => None,
        ("Reshape", Some(shape)) => first.reshaped(&shape.wholes()),
        ("Transpose", None) => first.transposed(node.integers("perm")),
        ("Flatten", None) => flat(first, node.integer("axis").unwrap_or(1)),
        ("Unsqueeze" | "Squeeze", axes) => {
            let axes = axes.map(Array::wholes).or(node.integers("axes").map(<[i64]>::to_vec));
            ones(first, axes.as_deref(), node.operation == "Unsqueeze")
        }
        ("Gather", Some(places)) if first.shape.len() == 1 => picked(first, places),
        ("Concat", _) if first.shape.len() == 1 => {
            let lists: Option<Vec<&Array>> = inputs.iter().copied().collect();
            let joint =
                lists.map(|lists| lists.iter().flat_map(|list| list.numbers.clone()).collect());
            joint.map(|joint| Array::list(joint).integers(first.whole))
        }
        _ => return Err("of constants, which is not followed".to_owned()),
    };
    found.ok_or_else(|| format!("the shapes of `{}` do not go together", node.inputs.join("`, `")))
}

/// The numbers as another kind: integers are cut off towards 0, floats of 32 and 64 bits stay.
fn as_kind(array: &Array, kind: i64) -> Result<Array, String> {
    match kind {
        _ if INTEGERS.contains(&kind) => Ok(array.each(f64::trunc).integers(true)),
        _ if FLOATS.contains(&kind) => Ok(array.clone().integers(false)),
        _ => {
            Err("of constants to another kind than floats and integers of 32 and 64 bits"
                .to_owned())
        }
    }
}

/// `f` of all of them.
fn every(inputs: &[Option<&Array>], f: fn(f64, f64) -> f64) -> Option<Array> {
    let mut all = inputs.iter().flatten();
    let first = (*all.next()?).clone();
    all.try_fold(first, |joint, other| joint.with(other, f))
}

/// The name of what a node gives.
fn name(node: &Node) -> &str {
    node.outputs.first().map_or("", String::as_str)
}

/// The numbers of a list at these places, in their shape.
fn picked(list: &Array, places: &Array) -> Option<Array> {
    let count = list.numbers.len() as i64;
    let at = |place: i64| usize::try_from(if place < 0 { place + count } else { place }).ok();
    let pick = |place: i64| list.numbers.get(at(place)?).copied();
    let numbers = places.wholes().into_iter().map(pick).collect::<Option<Vec<f64>>>()?;
    Array::new(places.shape.clone(), &numbers).map(|array| array.integers(list.whole))
}

/// Two dimensions: those before `axis`, and the others.
fn flat(array: &Array, axis: i64) -> Option<Array> {
    let rank = array.shape.len() as i64;
    let axis = usize::try_from(if axis < 0 { axis + rank } else { axis }).ok()?;
    let rows: usize = array.shape.get(..axis)?.iter().product();
    let columns: usize = array.shape.get(axis..)?.iter().product();
    array.filling(vec![rows, columns])
}

/// Dimensions of length 1 put in or taken out.
fn ones(array: &Array, axes: Option<&[i64]>, insert: bool) -> Option<Array> {
    let mut shape = array.shape.clone();
    let Some(axes) = axes else {
        shape.retain(|&length| length != 1 || insert);
        return array.filling(shape);
    };
    let rank = (shape.len() + if insert { axes.len() } else { 0 }) as i64;
    let place = |&axis: &i64| usize::try_from(if axis < 0 { axis + rank } else { axis }).ok();
    let mut places = axes.iter().map(place).collect::<Option<Vec<usize>>>()?;
    places.sort_unstable();
    for place in if insert { places } else { places.into_iter().rev().collect() } {
        match insert {
            true if place <= shape.len() => shape.insert(place, 1),
            false if shape.get(place) == Some(&1) => _ = shape.remove(place),
            _ => return None,
        }
    }
    array.filling(shape)
}
