//! Functions of PyTorch that are activations, as TorchScript writes their calls.

use super::classes::{Code, is_name};
use crate::policy::Activation;

/// Where PyTorch's own functions lie.
pub(super) const FUNCTIONS: &str = "__torch__.torch.nn.functional.";

/// The activation that `torch.NAME` is, behind its argument these; identity for what does nothing in use.
pub(super) fn activation(name: &str, settings: &[&str]) -> Option<Activation> {
    let number = |i: usize| settings.get(i)?.parse::<f32>().ok();
    let found = match (name.trim_end_matches('_'), settings) {
        ("relu", []) => Activation::Relu,
        ("relu6", []) => Activation::Relu6,
        ("tanh", []) => Activation::Tanh,
        ("sigmoid", []) => Activation::Sigmoid,
        ("silu", []) => Activation::Silu,
        ("mish", []) => Activation::Mish,
        ("selu", []) => Activation::Selu,
        ("softsign", []) => Activation::Softsign,
        ("gelu", [] | ["approximate=\"none\""]) => Activation::Gelu,
        ("gelu", ["approximate=\"tanh\""]) => Activation::GeluTanh,
        ("elu", [_] | [_, "1", "1"]) => Activation::Elu { alpha: number(0)? },
        ("celu", [_]) => Activation::Celu { alpha: number(0)? },
        ("leaky_relu", [_]) => Activation::LeakyRelu { slope: number(0)? },
        ("softplus", [_, "20" | "20."]) => Activation::Softplus { beta: number(0)? },
        ("hardtanh" | "clamp", [_, _]) => match [number(0)?, number(1)?] {
            [0.0, 6.0] => Activation::Relu6,
            [low, high] => Activation::Hardtanh { low, high },
        },
        ("dropout" | "alpha_dropout", [_, "False"]) | ("flatten", ["1"]) => Activation::Identity,
        _ => return None,
    };
    found.check().is_ok().then_some(found)
}

/// The same of `torch.nn.functional.NAME`, where the code of that function calls `torch.NAME`.
pub(super) fn functional(code: &Code<'_>, name: &str, settings: &[&str]) -> Option<Activation> {
    let settings = match settings {
        [settings @ .., "True" | "False"] => settings,
        all => all,
    };
    is_usual(code, name).then(|| activation(name, settings))?
}

/// Whether each branch of a function of PyTorch gives `torch.NAME` of what the function is given.
fn is_usual(code: &Code<'_>, name: &str) -> bool {
    let Some(function) = code.functions.get(&format!("{FUNCTIONS}{name}")) else { return false };
    let given = function.parameters.iter().copied().filter(|&parameter| parameter != "inplace");
    let given = given.collect::<Vec<_>>().join(", ");
    let calls = match name {
        "softsign" => vec!["torch.div(input, torch.add(torch.abs(input), 1))".to_owned()],
        _ => vec![format!("torch.{name}({given})"), format!("torch.{name}_({given})")],
    };
    let is_call = |line: &&str| {
        line.split_once(" = ").is_some_and(|(_, said)| calls.iter().any(|call| call == said))
    };
    let is_plain = |line: &&str| match line.trim().split_once(" = ") {
        Some((name, said)) => {
            is_call(line) || (is_name(name) && said != "input" && is_setting(said))
        }
        None => is_control(line.trim()),
    };
    function.body.iter().any(is_call) && function.body.iter().all(is_plain)
}

/// Whether an expression is a name, a text, or a comparison.
fn is_setting(said: &str) -> bool {
    is_name(said) || said.starts_with('"') || said.starts_with("torch.gt(p, ")
}

/// Whether a line without an assignment computes nothing.
fn is_control(line: &str) -> bool {
    let returned = line.strip_prefix("return ");
    returned.is_some_and(|name| is_name(name) && name != "input")
        || line.starts_with("if ")
        || line.starts_with("ops.prim.RaiseException(")
        || ["else:", "pass"].contains(&line)
}
