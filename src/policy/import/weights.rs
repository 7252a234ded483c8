//! Operations of a graph that have weights: layers, convolutions over the whole input, and norms.

use super::array::Array;
use super::draft::Step;
use super::linear::Linear;
use super::map::Map;
use super::walk::{Number, Problem, Value, Walk, constant, optional};
use crate::policy::onnx::Node;

/// A product with a weight `[inputs, outputs]`, and the value on its left.
pub(super) fn product(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    weight: &Array,
) -> Result<Value, Problem> {
    let [inputs, outputs] = sides(&node.inputs[1], weight)?;
    let linear = Linear::transposed(&weight.numbers, [inputs, outputs]);
    let axis = number.form.axis(-1)?;
    layer(walk, &node.inputs[1], along(number, axis, outputs)?, linear)
}

/// A product with a weight `[outputs, inputs]` on the left of the value.
pub(super) fn left_product(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    weight: &Array,
) -> Result<Value, Problem> {
    let [outputs, inputs] = sides(&node.inputs[0], weight)?;
    let number = Number { form: number.form.into_column(), ..number };
    // The last dimension but one, or the only one.
    let axis = number.form.rank().saturating_sub(2);
    let number = along(number, axis, outputs)?;
    layer(walk, &node.inputs[0], number, Linear::new(weight.numbers.clone(), inputs))
}

/// `Gemm`: a product with a factor, and what is added.
pub(super) fn gemm(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    if node.integer("transA").unwrap_or(0) != 0 {
        return Err("with transA, which no dense layer has".into());
    }
    let weight = constant(rest, 0)?;
    let [rows, columns] = sides(&node.inputs[1], weight)?;
    let alpha = f64::from(node.float("alpha").unwrap_or(1.0));
    let scaled: Vec<f64> = weight.numbers.iter().map(|weight| alpha * weight).collect();
    let mut linear = match node.integer("transB").unwrap_or(0) {
        0 => Linear::transposed(&scaled, [rows, columns]),
        _ => Linear::new(scaled, columns),
    };
    if number.form.rank() != 2 {
        return Err(format!("of a value {}; it takes matrices alone", number.form).into());
    }
    let mut number = along(number, 1, linear.outputs())?;
    if let Some(bias) = optional(rest, 1)? {
        number = number.beside(bias)?;
        let beta = f64::from(node.float("beta").unwrap_or(1.0));
        linear.bias = bias_of(&node.inputs[2], bias, linear.outputs())?;
        linear.bias.iter_mut().for_each(|bias| *bias *= beta);
    }
    layer(walk, &node.inputs[1], number, linear)
}

/// `Conv` whose kernel is as large as the input: each channel that comes out is one number.
pub(super) fn convolution(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    let plain = |name: &str, usual: i64| {
        node.integers(name).is_none_or(|all| all.iter().all(|&i| i == usual))
    };
    let weight = constant(rest, 0)?;
    let (outputs, inputs) = match weight.shape.as_slice() {
        [outputs, kernel @ ..] if kernel.len() > 1 => (*outputs, kernel.iter().product::<usize>()),
        _ => return Err(format!("`{}` has shape {:?}", node.inputs[1], weight.shape).into()),
    };
    let width = number.rows.as_ref().map(Vec::len).or(walk.draft.width());
    let whole = width == Some(inputs) && plain("pads", 0) && plain("dilations", 1);
    if !matches!(node.text("auto_pad"), "" | "NOTSET" | "VALID") {
        return Err(format!("with auto_pad {}", node.text("auto_pad")).into());
    }
    if !whole || node.integer("group").unwrap_or(1) != 1 || weight.numbers.is_empty() {
        return Err("whose kernel is not as large as its input".into());
    }
    let mut linear = Linear::new(weight.numbers.clone(), inputs);
    if let Some(bias) = optional(rest, 1)? {
        linear.bias = bias_of(&node.inputs[2], bias, outputs)?;
    }
    let form = number.form.convolved(&weight.shape)?;
    layer(walk, &node.inputs[1], Number { form, ..number }, linear)
}

/// The value whose numbers lie along a dimension, which becomes one of `outputs` numbers.
fn along(number: Number, axis: usize, outputs: usize) -> Result<Number, Problem> {
    number.form.along(axis)?;
    let form = number.form.replaced(axis, &[outputs]);
    Ok(Number { form, ..number })
}

/// Adds a layer with the weight `name`.
fn layer(walk: &mut Walk, name: &str, number: Number, linear: Linear) -> Result<Value, Problem> {
    walk.layers.push(name.to_owned());
    walk.push(number, linear.inputs, Step::Linear(linear))
}

/// The numbers of a bias.
fn bias_of(name: &str, bias: &Array, outputs: usize) -> Result<Vec<f64>, Problem> {
    match (bias.uniform(), bias.numbers.len()) {
        (Some(one), 1) => Ok(vec![one; outputs]),
        (_, have) if have == outputs => Ok(bias.numbers.clone()),
        _ => {
            Err(format!("`{name}` has shape {:?}, its layer {outputs} outputs", bias.shape).into())
        }
    }
}

/// The two lengths of a weight, neither of them 0.
fn sides(name: &str, weight: &Array) -> Result<[usize; 2], Problem> {
    match *weight.shape.as_slice() {
        [rows, columns] if rows > 0 && columns > 0 => Ok([rows, columns]),
        _ => {
            Err(format!("`{name}` has shape {:?}; a weight has two dimensions", weight.shape)
                .into())
        }
    }
}

/// `BatchNormalization` with statistics that stand.
pub(super) fn batch_norm(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    if node.integer("training_mode").unwrap_or(0) != 0 || node.outputs.len() > 1 {
        return Err("in training mode, where it takes statistics of the inputs; export the model in eval mode".into());
    }
    number.form.along(1)?;
    let epsilon = f64::from(node.float("epsilon").unwrap_or(1e-5));
    let [scale, shift, mean, variance] =
        [constant(rest, 0)?, constant(rest, 1)?, constant(rest, 2)?, constant(rest, 3)?];
    let width = scale.numbers.len();
    if [shift, mean, variance].iter().any(|other| other.numbers.len() != width) {
        return Err("with statistics of different lengths".into());
    }
    let deviation: Vec<f64> =
        variance.numbers.iter().map(|variance| (variance + epsilon).sqrt()).collect();
    let normal = Map::normal(&mean.numbers, &deviation);
    let map = normal.then(&Map::affine(scale.numbers.clone(), shift.numbers.clone()));
    walk.push(number, width, Step::Map(map))
}

/// `LayerNormalization` over all numbers.
pub(super) fn layer_norm(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    let axis = number.form.axis(node.integer("axis").unwrap_or(-1))?;
    number.form.along(axis)?;
    if axis + 1 != number.form.rank() {
        return Err("over something else than the last dimension".into());
    }
    let scale = constant(rest, 0)?.numbers.clone();
    let shift = optional(rest, 1)?.map_or(vec![0.0; scale.len()], |shift| shift.numbers.clone());
    if shift.len() != scale.len() {
        return Err("with factors and summands of different lengths".into());
    }
    let epsilon = node.float("epsilon").unwrap_or(1e-5);
    walk.push(number, scale.len(), Step::Norm { scale, shift, epsilon })
}
