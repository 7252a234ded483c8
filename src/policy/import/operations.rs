//! What each operation of a graph does to a network.

use super::array::Array;
use super::draft::Step;
use super::elementwise::{Each, erf};
use super::map::Map;
use super::parts;
use super::walk::{Number, Problem, Value, Walk, constant, optional};
use super::weights::{batch_norm, convolution, gemm, layer_norm, left_product, product};
use crate::policy::Activation;
use crate::policy::onnx::Node;

/// The operations that are followed.
pub(super) const OPERATIONS: [&str; 45] = [
    "Gemm",
    "MatMul",
    "Conv (over the whole input)",
    "Add",
    "Sub",
    "Mul",
    "Div",
    "Neg",
    "Clip",
    "Max",
    "Min",
    "Relu",
    "LeakyRelu",
    "PRelu",
    "Elu",
    "Selu",
    "Celu",
    "Gelu",
    "Swish",
    "Mish",
    "Tanh",
    "Sigmoid",
    "HardSigmoid",
    "Softplus",
    "Softsign",
    "Erf",
    "Exp",
    "Log",
    "Sqrt",
    "Abs",
    "Pow",
    "Reciprocal",
    "BatchNormalization",
    "LayerNormalization",
    "Identity",
    "Cast",
    "Dropout",
    "Flatten",
    "Reshape",
    "Squeeze",
    "Unsqueeze",
    "Transpose",
    "Split",
    "Slice",
    "Gather",
];
/// Kinds of numbers that a cast may lead to.
const FLOATS: [i64; 2] = [1, 11];
/// The constants of SELU as ONNX has them.
const SELU: [f32; 2] = [1.673_263_2, 1.050_701];

/// What operation `node` gives for `inputs`, of which one at least depends on the input of the graph.
///
/// # Errors
/// What is wrong with it, or that no dense network has it.
pub(super) fn apply(
    walk: &mut Walk,
    node: &Node,
    inputs: Vec<Option<Value>>,
) -> Result<Vec<Value>, Problem> {
    let operation = node.operation.as_str();
    let mut inputs = inputs.into_iter();
    let first = inputs.next().flatten().ok_or("an input is missing")?;
    let rest: Vec<Option<Value>> = inputs.collect();
    let known = OPERATIONS.iter().any(|name| name.split(' ').next() == Some(operation));
    let number = match first {
        Value::Number(_) if operation == "Shape" => return Ok(vec![Value::Sizes]),
        Value::Number(number) => number,
        Value::Sizes => return Ok(vec![Value::Sizes]),
        Value::Constant(constant) => return from_constant(walk, node, constant, rest),
    };
    if !known {
        return Err(Problem::Unknown);
    }
    let one = |value: Result<Value, Problem>| value.map(|value| vec![value]);
    match operation {
        "Identity" | "Dropout" | "Flatten" | "Reshape" | "Squeeze" | "Unsqueeze" => {
            Ok(vec![Value::Number(number)])
        }
        "Cast" if FLOATS.contains(&node.integer("to").unwrap_or(1)) => {
            Ok(vec![Value::Number(number)])
        }
        "Cast" => Err("to another kind of number".into()),
        "Transpose" => one(transposed(node, number)),
        "Gemm" => one(gemm(walk, node, number, &rest)),
        "MatMul" => one(product(walk, node, number, constant(&rest, 0)?)),
        "Conv" => one(convolution(walk, node, number, &rest)),
        "Add" | "Sub" | "Mul" | "Div" | "Max" | "Min" | "Pow" => {
            one(binary(walk, node, number, &rest))
        }
        "PRelu" => one(leaky(number, constant(&rest, 0)?)),
        "Clip" => one(clip(walk, node, number, &rest)),
        "BatchNormalization" => one(batch_norm(walk, node, number, &rest)),
        "LayerNormalization" => one(layer_norm(walk, node, number, &rest)),
        "Split" | "Slice" | "Gather" => parts::apply(walk, node, number, &rest),
        _ => one(unary(node, number)),
    }
}

/// Operations of a constant and a value.
fn from_constant(
    walk: &mut Walk,
    node: &Node,
    constant: Array,
    mut rest: Vec<Option<Value>>,
) -> Result<Vec<Value>, Problem> {
    let number = match rest.first_mut().map(Option::take) {
        Some(Some(Value::Number(number))) => number,
        // Lengths, put together with others.
        _ => return Ok(vec![Value::Sizes]),
    };
    let value = match node.operation.as_str() {
        "Add" | "Mul" | "Max" | "Min" => {
            binary(walk, node, number, &[Some(Value::Constant(constant))])
        }
        "Sub" => {
            let turned = then(number, Each::Affine { scale: -1.0, shift: 0.0 });
            add(walk, turned, &constant)
        }
        "Div" if constant.uniform().is_some() => {
            let one = constant.uniform().unwrap_or_default();
            Ok(through(number, move |x| one / x))
        }
        "MatMul" => left_product(walk, node, number, &constant),
        _ => Err("of a constant and a value, in this order".into()),
    };
    value.map(|value| vec![value])
}

/// The value with one more operation.
fn then(mut number: Number, each: Each) -> Number {
    number.expression = number.expression.then(each);
    number
}

/// The value through a function that is no activation by itself.
fn through(mut number: Number, f: impl Fn(f64) -> f64) -> Value {
    number.expression = number.expression.through(f);
    Value::Number(number)
}

/// An operation of each number.
fn unary(node: &Node, number: Number) -> Result<Value, Problem> {
    let alpha = |usual: f32| node.float("alpha").unwrap_or(usual);
    let activation = match node.operation.as_str() {
        "Relu" => Activation::Relu,
        "Tanh" => Activation::Tanh,
        "Sigmoid" => Activation::Sigmoid,
        "LeakyRelu" => Activation::LeakyRelu { slope: alpha(0.01) },
        "Elu" => Activation::Elu { alpha: alpha(1.0) },
        "Celu" => Activation::Celu { alpha: alpha(1.0) },
        "Selu" if [alpha(SELU[0]), node.float("gamma").unwrap_or(SELU[1])] == SELU => {
            Activation::Selu
        }
        "Selu" => return Err("with constants of its own".into()),
        "Gelu" if node.text("approximate") == "tanh" => Activation::GeluTanh,
        "Gelu" => Activation::Gelu,
        "Swish" if alpha(1.0) == 1.0 => Activation::Silu,
        "Swish" => return Err("with an alpha that is not 1".into()),
        "Mish" => Activation::Mish,
        "Softplus" => Activation::Softplus { beta: 1.0 },
        "Softsign" => Activation::Softsign,
        "HardSigmoid" => {
            let (scale, shift) = (alpha(0.2).into(), node.float("beta").unwrap_or(0.5).into());
            let line = then(number, Each::Affine { scale, shift });
            return Ok(Value::Number(then(line, Each::Clamp { low: 0.0, high: 1.0 })));
        }
        "Neg" => return Ok(Value::Number(then(number, Each::Affine { scale: -1.0, shift: 0.0 }))),
        "Erf" => return Ok(through(number, erf)),
        "Exp" => return Ok(through(number, f64::exp)),
        "Log" => return Ok(through(number, f64::ln)),
        "Sqrt" => return Ok(through(number, f64::sqrt)),
        "Abs" => return Ok(through(number, f64::abs)),
        "Reciprocal" => return Ok(through(number, |x| 1.0 / x)),
        _ => return Err(Problem::Unknown),
    };
    Ok(Value::Number(then(number, Each::Activation(activation))))
}

/// An operation of each number and another, which is a constant or of the same number.
fn binary(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    let operation = node.operation.as_str();
    if let Some(Some(Value::Number(other))) = rest.first() {
        return both(node, number, other);
    }
    let other = constant(rest, 0)?;
    match operation {
        "Add" => add(walk, number, other),
        "Sub" => add(walk, number, &other.each(|x| -x)),
        "Mul" => scale(walk, number, other),
        "Div" => scale(walk, number, &other.each(|x| 1.0 / x)),
        "Max" => clamp(walk, number, Some(other), None),
        "Min" => clamp(walk, number, None, Some(other)),
        _ => match other.uniform() {
            Some(power) => Ok(through(number, |x| x.powf(power))),
            None => Err("with powers that differ".into()),
        },
    }
}

/// An operation of two expressions of the same number.
fn both(node: &Node, number: Number, other: &Number) -> Result<Value, Problem> {
    if number.at != other.at || number.rows != other.rows {
        let old = if number.at < other.at { 0 } else { 1 };
        return Err(Problem::Stale(node.inputs[old].clone()));
    }
    let f = match node.operation.as_str() {
        "Add" => |a, b| a + b,
        "Sub" => |a, b| a - b,
        "Mul" => |a, b| a * b,
        "Div" => |a, b| a / b,
        "Max" => f64::max,
        "Min" => f64::min,
        _ => return Err("of two values that both depend on the input".into()),
    };
    let expression = number.expression.with(&other.expression, f);
    Ok(Value::Number(Number { expression, ..number }))
}

/// `number + constant`.
fn add(walk: &mut Walk, number: Number, constant: &Array) -> Result<Value, Problem> {
    match constant.uniform() {
        Some(shift) => Ok(Value::Number(then(number, Each::Affine { scale: 1.0, shift }))),
        None => {
            let shift = constant.numbers.clone();
            let map = Map::affine(vec![1.0; shift.len()], shift);
            walk.push(number, map.width(), Step::Map(map))
        }
    }
}

/// `number * constant`.
fn scale(walk: &mut Walk, number: Number, constant: &Array) -> Result<Value, Problem> {
    match constant.uniform() {
        Some(scale) => Ok(Value::Number(then(number, Each::Affine { scale, shift: 0.0 }))),
        None => {
            let scale = constant.numbers.clone();
            let map = Map::affine(scale.clone(), vec![0.0; scale.len()]);
            walk.push(number, map.width(), Step::Map(map))
        }
    }
}

/// The value within limits.
fn clamp(
    walk: &mut Walk,
    number: Number,
    low: Option<&Array>,
    high: Option<&Array>,
) -> Result<Value, Problem> {
    let one = |limit: Option<&Array>, none: f64| limit.map_or(Some(none), Array::uniform);
    if let (Some(low), Some(high)) = (one(low, f64::NEG_INFINITY), one(high, f64::INFINITY)) {
        return Ok(Value::Number(then(number, Each::Clamp { low, high })));
    }
    let width =
        low.into_iter().chain(high).map(|limit| limit.numbers.len()).max().unwrap_or_default();
    let all = |limit: Option<&Array>, none: f64| match limit.map(|limit| limit.numbers.as_slice()) {
        None => Some(vec![none; width]),
        Some([one]) => Some(vec![*one; width]),
        Some(several) => (several.len() == width).then(|| several.to_vec()),
    };
    let limits = all(low, f64::NEG_INFINITY).zip(all(high, f64::INFINITY));
    let (low, high) = limits.ok_or("limits of different lengths")?;
    walk.push(number, width, Step::Map(Map::clamp(low, high)))
}

/// `Clip`: limits as inputs, or as attributes.
fn clip(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: &[Option<Value>],
) -> Result<Value, Problem> {
    let limit = |i: usize, name: &str| -> Result<Option<Array>, Problem> {
        let attribute = node.float(name).map(|limit| Array::number(limit.into()));
        Ok(optional(rest, i)?.cloned().or(attribute))
    };
    let (low, high) = (limit(0, "min")?, limit(1, "max")?);
    let one = |limit: &Option<Array>| limit.as_ref().and_then(Array::uniform);
    let activation = match (one(&low), one(&high)) {
        (Some(0.0), None) if high.is_none() => Activation::Relu,
        (Some(0.0), Some(6.0)) => Activation::Relu6,
        (Some(low), Some(high)) if low.is_finite() && high.is_finite() => {
            Activation::Hardtanh { low: low as f32, high: high as f32 }
        }
        _ => return clamp(walk, number, low.as_ref(), high.as_ref()),
    };
    Ok(Value::Number(then(number, Each::Activation(activation))))
}

/// `PRelu` with one slope.
fn leaky(number: Number, slope: &Array) -> Result<Value, Problem> {
    let slope = slope.uniform().ok_or("with slopes that differ")?;
    let activation = Activation::LeakyRelu { slope: slope as f32 };
    Ok(Value::Number(then(number, Each::Activation(activation))))
}

/// `Transpose`, which leaves a row or a column what it is.
fn transposed(node: &Node, number: Number) -> Result<Value, Problem> {
    match node.integers("perm") {
        None | Some([1, 0]) => Ok(Value::Number(number)),
        Some(order) if order.iter().copied().eq(0..order.len() as i64) => Ok(Value::Number(number)),
        Some(order) => Err(format!("of a value, with the order {order:?}").into()),
    }
}
