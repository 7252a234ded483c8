//! What each operation of a graph does to a network.

use super::arrange;
use super::array::Array;
use super::constants::FLOATS;
use super::draft::Step;
use super::elementwise::{Each, erf};
use super::joined;
use super::map::Map;
use super::parts;
use super::walk::{Number, Problem, Value, Walk, constant, optional};
use super::weights::{batch_norm, convolution, gemm, layer_norm, left_product, product};
use crate::policy::Activation;
use crate::policy::onnx::Node;

/// The operations that are followed.
pub(super) const OPERATIONS: [&str; 49] = [
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
    "GatherND (of one dimension)",
    "Concat (of parts of one value)",
    "Greater (of a constant, before Where)",
    "Where (of a softplus and its input)",
];
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
    let number = match first {
        Value::Number(number) if operation == "Shape" => return lengths(node, &number),
        Value::Number(number) => number,
        Value::Sizes => return sizes(&rest),
        Value::Above(scaled, limit) if operation == "Where" => {
            return softplus(&scaled, limit, rest).map(|value| vec![value]);
        }
        Value::Above(..) => {
            return Err("of what is true or false, which `Where` alone takes".into());
        }
        Value::Constant(constant) => return from_constant(walk, node, constant, rest),
    };
    let one = |value: Result<Value, Problem>| value.map(|value| vec![value]);
    match operation {
        "Identity" | "Dropout" => Ok(vec![Value::Number(number)]),
        "Flatten" | "Reshape" | "Squeeze" | "Unsqueeze" | "Transpose" => {
            one(arrange::apply(node, number, &rest))
        }
        "Cast" if FLOATS.contains(&node.integer("to").unwrap_or(1)) => {
            Ok(vec![Value::Number(number)])
        }
        "Cast" => Err("to another kind of number".into()),
        "Gemm" => one(gemm(walk, node, number, &rest)),
        "MatMul" => one(product(walk, node, number, constant(&rest, 0)?)),
        "Conv" => one(convolution(walk, node, number, &rest)),
        "Max" | "Min" => one(extreme(walk, node, number, rest)),
        "Add" | "Sub" | "Mul" | "Div" | "Pow" => one(binary(walk, node, number, &rest)),
        "Greater" => match constant(&rest, 0)?.uniform() {
            Some(limit) => Ok(vec![Value::Above(number.beside(constant(&rest, 0)?)?, limit)]),
            None => Err("with limits that differ".into()),
        },
        "PRelu" => one(leaky(number, constant(&rest, 0)?)),
        "Clip" => one(clip(walk, node, number, &rest)),
        "BatchNormalization" => one(batch_norm(walk, node, number, &rest)),
        "LayerNormalization" => one(layer_norm(walk, node, number, &rest)),
        "Concat" => one(joined::apply(walk, node, number, rest)),
        "Split" | "Slice" | "Gather" | "GatherND" => parts::apply(walk, node, number, &rest),
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
    let is_number = |value: &Option<Value>| matches!(value, Some(Value::Number(_)));
    let first = rest.iter().position(is_number);
    // Lengths, put together with others.
    let Some(first) = first else { return sizes(&rest) };
    let constant = Some(Value::Constant(constant));
    let Some(Value::Number(number)) = std::mem::replace(&mut rest[first], constant.clone()) else {
        return Err(Problem::Unknown);
    };
    let operation = node.operation.as_str();
    if matches!(operation, "Max" | "Min") {
        return extreme(walk, node, number, rest).map(|value| vec![value]);
    }
    if operation == "Concat" {
        return Err("of a value and a constant".into());
    }
    if first > 0 {
        return Err("of a constant and a value, in this order".into());
    }
    let Some(Value::Constant(constant)) = constant else { return Err(Problem::Unknown) };
    let value = match operation {
        "Add" | "Mul" => binary(walk, node, number, &[Some(Value::Constant(constant))]),
        "Sub" => {
            let turned = then(number, Each::Affine { scale: -1.0, shift: 0.0 });
            add(walk, turned.beside(&constant)?, &constant)
        }
        "Div" if constant.uniform().is_some() => {
            let one = constant.uniform().unwrap_or_default();
            Ok(through(number.beside(&constant)?, move |x| one / x))
        }
        "MatMul" => left_product(walk, node, number, &constant),
        _ => Err("of a constant and a value, in this order".into()),
    };
    value.map(|value| vec![value])
}

/// `Where` of a softplus that is its input beyond a threshold, as PyTorch has it.
fn softplus(scaled: &Number, limit: f64, rest: Vec<Option<Value>>) -> Result<Value, Problem> {
    let [Some(Value::Number(beyond)), Some(Value::Number(number))] = rest.as_slice() else {
        return Err("that picks no two values of the network".into());
    };
    let alike = |other: &Number| other.rows == number.rows && other.form == number.form;
    let found = number.expression.up_to(&scaled.expression, limit, &beyond.expression);
    match found.filter(|_| alike(scaled) && alike(beyond)) {
        Some(expression) => Ok(Value::Number(Number { expression, ..number.clone() })),
        None => Err(format!(
            "that is no softplus beside its input, or one whose threshold, {limit}, is so low that it jumps there; \
             nn.Softplus has 20"
        )
        .into()),
    }
}

/// The lengths of a value.
fn lengths(node: &Node, number: &Number) -> Result<Vec<Value>, Problem> {
    match (node.integer("start"), node.integer("end")) {
        (None | Some(0), None) => Ok(vec![Walk::sizes(number)]),
        _ => Err("of some dimensions alone".into()),
    }
}

/// What an operation makes of lengths that are not all known: others of them, as long as no number is among them.
fn sizes(rest: &[Option<Value>]) -> Result<Vec<Value>, Problem> {
    match rest.iter().any(|value| matches!(value, Some(Value::Number(_)))) {
        true => Err("of lengths and a value".into()),
        false => Ok(vec![Value::Sizes]),
    }
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
        return both(node, number, other).map(Value::Number);
    }
    let other = constant(rest, 0)?;
    let number = number.beside(other)?;
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

/// `Max` or `Min` of a value and any number of others: first of those of the same number, then of the constants.
fn extreme(
    walk: &mut Walk,
    node: &Node,
    number: Number,
    rest: Vec<Option<Value>>,
) -> Result<Value, Problem> {
    let pick = |a: f64, b: f64| match node.operation.as_str() {
        // A number that is none stays so, and is refused.
        _ if a.is_nan() || b.is_nan() => f64::NAN,
        "Max" => a.max(b),
        _ => a.min(b),
    };
    let (mut value, mut limit) = (number, None::<Array>);
    for other in rest.into_iter().flatten() {
        match other {
            Value::Number(other) => value = both(node, value, &other)?,
            Value::Constant(other) => {
                let joint = limit.as_ref().map_or(Some(other.clone()), |a| a.with(&other, pick));
                limit = Some(joint.ok_or("of constants whose shapes do not go together")?);
            }
            Value::Sizes | Value::Above(..) => return Err("of values of different kinds".into()),
        }
    }
    match limit {
        Some(limit) => binary(walk, node, value, &[Some(Value::Constant(limit))]),
        None => Ok(Value::Number(value)),
    }
}

/// An operation of two expressions of the same number.
fn both(node: &Node, number: Number, other: &Number) -> Result<Number, Problem> {
    if number.rows != other.rows {
        return Err("of two parts of the same value".into());
    }
    if number.form != other.form {
        let (one, other) = (&number.form, &other.form);
        return Err(format!("of a value {one} and the same as {other}").into());
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
    Ok(Number { expression, ..number })
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
    let number = low.iter().chain(&high).try_fold(number, Number::beside)?;
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
    let number = number.beside(slope)?;
    let slope = slope.uniform().ok_or("with slopes that differ")?;
    let activation = Activation::LeakyRelu { slope: slope as f32 };
    Ok(Value::Number(then(number, Each::Activation(activation))))
}
