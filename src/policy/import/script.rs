//! The code of a TorchScript module, read as text and never executed: whether its parts are applied one after the other,
//! and nothing else is done.

use std::collections::{HashMap, HashSet};

use super::archive::Entries;

/// Longest file of code, bytes.
const LONGEST: usize = 1 << 22;
/// Where the code of PyTorch's own modules and functions lies.
const MODULES: &str = "code/__torch__/torch/nn/modules/";
const FUNCTIONS: &str = "code/__torch__/torch/nn/functional";
/// Functions of PyTorch that are activations, of one argument.
const ACTIVATIONS: [&str; 9] = [
    "torch.relu",
    "torch.tanh",
    "torch.sigmoid",
    "torch.silu",
    "torch.mish",
    "torch.selu",
    "torch.relu6",
    "torch.hardtanh",
    "torch.softplus",
];
/// Modules of PyTorch that keep numbers one after the other: layers, containers, activations and what does nothing.
const PLAIN: [&str; 21] = [
    "Linear",
    "Sequential",
    "ModuleList",
    "Identity",
    "Dropout",
    "AlphaDropout",
    "Flatten",
    "ReLU",
    "LeakyReLU",
    "ELU",
    "SELU",
    "CELU",
    "GELU",
    "SiLU",
    "Mish",
    "Tanh",
    "Sigmoid",
    "Softplus",
    "Softsign",
    "Hardtanh",
    "ReLU6",
];

/// What the code of a module does.
#[derive(Debug, Default)]
pub(super) struct Script {
    /// Parts in the order in which each class of its own applies them.
    chains: Vec<Vec<String>>,
    /// The first line or class that is something else.
    more: Option<String>,
}

/// What a name stands for within a function.
#[derive(Clone, Debug)]
enum Value {
    /// What the function is given, after these parts.
    Chain(Vec<String>),
    /// A part of the module.
    Part(String),
}

/// The code in the archive of a compiled module.
///
/// # Errors
/// A sentence about an entry that is damaged.
pub(super) fn read(entries: &mut Entries<'_>) -> Result<Script, String> {
    let mut script = Script::default();
    for name in entries.within("code/") {
        if name.ends_with(".py") && !name.starts_with(FUNCTIONS) {
            let code = entries.inflated(&name, LONGEST)?;
            script.add(&String::from_utf8_lossy(&code), name.starts_with(MODULES));
        }
    }
    Ok(script)
}

impl Script {
    /// What it does besides applying these layers one after the other, if anything.
    pub(super) fn beyond(&self, layers: &[&str]) -> Option<String> {
        if let Some(more) = &self.more {
            return Some(more.clone());
        }
        let apart = self.chains.iter().find(|chain| !follows(chain, layers));
        if let Some(chain) = apart {
            return Some(format!("it applies {}", chain.join(", then ")));
        }
        let of = |layer: &str, chain: &[String]| place(chain, layer).is_some();
        let idle = layers.iter().find(|layer| !self.chains.iter().any(|chain| of(layer, chain)));
        let idle = idle.filter(|_| !self.chains.is_empty());
        idle.map(|layer| format!("`{layer}` is not applied"))
    }

    /// Adds a file of code, of PyTorch itself or of anybody else.
    fn add(&mut self, code: &str, is_library: bool) {
        let lines: Vec<&str> = code.lines().collect();
        for (i, line) in lines.iter().enumerate() {
            let class = line.strip_prefix("class ").and_then(|rest| rest.split('(').next());
            if let Some(class) = class.filter(|class| is_library && !PLAIN.contains(class)) {
                self.more.get_or_insert_with(|| format!("a module `{class}`"));
            }
            if !is_library && line.trim_start().starts_with("def forward(") {
                match forward(&lines[i..]) {
                    Ok(chain) => self.chains.push(chain),
                    Err(line) => _ = self.more.get_or_insert(line),
                }
            }
        }
    }
}

/// Whether the layers come in the order of the parts that they lie in, each part once.
fn follows(chain: &[String], layers: &[&str]) -> bool {
    let places: Vec<usize> = layers.iter().filter_map(|layer| place(chain, layer)).collect();
    let distinct: HashSet<&String> = chain.iter().collect();
    places.is_sorted() && distinct.len() == chain.len()
}

/// The number of the part that a layer lies in.
fn place(chain: &[String], layer: &str) -> Option<usize> {
    chain.iter().position(|part| layer.split('.').any(|key| key == part))
}

/// The parts that the function at the beginning of `lines` applies, one after the other.
///
/// # Errors
/// The first line that does something else.
fn forward(lines: &[&str]) -> Result<Vec<String>, String> {
    let head = lines.iter().position(|line| line.contains("->") && line.ends_with(':'));
    let head = head.ok_or_else(|| "a function without an end of its head".to_owned())?;
    let (names, body) = (lines[..=head].concat(), &lines[head + 1..]);
    let names = names.split_once('(').map_or("", |(_, rest)| rest);
    let names: Vec<&str> =
        names.split(',').filter_map(|name| Some(name.split_once(':')?.0.trim())).collect();
    let &[own, input] = names.as_slice() else {
        return Err(format!("it takes `{}`", names.join(", ")));
    };
    let mut values = HashMap::from([(input.to_owned(), Value::Chain(Vec::new()))]);
    for line in body {
        let other = || format!("`{}`", line.trim());
        if let Some(said) = line.trim().strip_prefix("return ") {
            return match value(said, own, &mut values) {
                Some(Value::Chain(chain)) => Ok(chain),
                _ => Err(other()),
            };
        }
        let (name, said) = line.split_once(" = ").ok_or_else(other)?;
        let found = value(said, own, &mut values).ok_or_else(other)?;
        values.insert(name.trim().to_owned(), found);
    }
    Err("a function that gives nothing".to_owned())
}

/// What an expression stands for; every name is used once, so that nothing branches.
fn value(text: &str, own: &str, values: &mut HashMap<String, Value>) -> Option<Value> {
    let text = text.trim().trim_end_matches(',').trim();
    if let Some(key) = text.strip_prefix("getattr(") {
        let key = key.strip_suffix(')')?.strip_prefix(own)?.strip_prefix(", \"")?;
        return Some(Value::Part(key.strip_suffix('"')?.to_owned()));
    }
    if let Some(key) = text.strip_prefix(own).and_then(|rest| rest.strip_prefix('.'))
        && is_name(key)
    {
        return Some(Value::Part(key.to_owned()));
    }
    if is_name(text) {
        return values.remove(text);
    }
    let inside = text.strip_suffix(')')?;
    let activation =
        ACTIVATIONS.iter().find_map(|name| inside.strip_prefix(name)?.strip_prefix('('));
    if let Some(argument) = activation {
        return value(argument, own, values).filter(|value| matches!(value, Value::Chain(_)));
    }
    let (part, argument) = inside.strip_prefix('(')?.split_once(").forward(")?;
    let Some(Value::Part(part)) = value(part, own, values) else { return None };
    let Some(Value::Chain(mut chain)) = value(argument, own, values) else { return None };
    chain.push(part);
    Some(Value::Chain(chain))
}

/// Whether a text is one name.
fn is_name(text: &str) -> bool {
    text.chars().all(|c| c.is_alphanumeric() || c == '_') && !text.is_empty()
}
