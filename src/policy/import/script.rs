//! The code of a TorchScript module against the layers that are imported of it: what follows each of them, or what
//! the code does besides.

use super::applied::{self, Flags, Layer, Step};
use super::archive::Entries;
use super::classes::Code;
use super::request::Request;
use crate::policy::Activation;

/// Longest file of code, bytes.
const LONGEST: usize = 1 << 22;
/// Most files of code.
const MOST_FILES: usize = 1000;

/// What the code of a module applies, or why that is not known.
#[derive(Debug)]
pub(super) struct Script(Result<Vec<Step>, String>);

/// What follows the layers, and what is to be said about it.
#[derive(Debug)]
pub(super) struct Settled {
    /// An activation for each layer, where the code says it.
    pub(super) activations: Option<Vec<Activation>>,
    /// What is to be said about it.
    pub(super) note: String,
}

/// The code in the archive of a compiled module with these flags.
///
/// # Errors
/// A sentence about an entry that is damaged.
pub(super) fn read(entries: &mut Entries<'_>, flags: &Flags) -> Result<Script, String> {
    let mut names = entries.within("code/");
    names.retain(|name| name.ends_with(".py"));
    if names.len() > MOST_FILES {
        let count = names.len();
        return Ok(Script(Err(format!("{count} files of code; {MOST_FILES} are read at most"))));
    }
    let mut texts = Vec::new();
    for name in names {
        let code = entries.inflated(&name, LONGEST)?;
        match String::from_utf8(code) {
            Ok(text) => texts.push((name, text)),
            Err(_) => return Ok(Script(Err(format!("`{name}` is no text in UTF-8")))),
        }
    }
    Ok(Script(steps(&texts, flags)))
}

/// What the code of these files applies.
fn steps(texts: &[(String, String)], flags: &Flags) -> Result<Vec<Step>, String> {
    let mut code = Code::default();
    for (name, text) in texts {
        code.add(name, text)?;
    }
    applied::steps(&code, flags)
}

impl Script {
    /// What follows each of these layers, as stated or else as the code has it.
    ///
    /// # Errors
    /// A sentence about code that does more than the layers, or other than is stated, unless all is stated.
    pub(super) fn settled(&self, layers: &[Layer], request: &Request) -> Result<Settled, String> {
        let is_stated = request.activation.is_some() && request.output.is_some();
        match self.behind(layers, !request.networks.is_empty()) {
            Ok(behind) => agreed(behind, request),
            Err(more) if is_stated => {
                let note = format!("not in it: the code of the module does more: {more}");
                Ok(Settled { activations: None, note })
            }
            Err(more) => Err(format!(
                "the code of this TorchScript module does more than its layers one after the other, as far as it can \
                 be read: {more}. An ONNX export keeps it: torch.onnx.export(module, torch.zeros(1, INPUTS), \
                 'policy.onnx', external_data=False), of the module before it is compiled; --activation and --output, both stated, import \
                 its layers in a row without it"
            )),
        }
    }

    /// The activation behind each of these layers, all that the code applies unless they are a part of it.
    fn behind(&self, layers: &[Layer], is_part: bool) -> Result<Vec<Activation>, String> {
        let mut applied: Vec<&Layer> = Vec::new();
        let mut behind: Vec<Vec<Activation>> = vec![Vec::new()];
        for step in self.0.as_ref().map_err(Clone::clone)? {
            match step {
                Step::Layer(layer) => {
                    applied.push(layer);
                    behind.push(Vec::new());
                }
                Step::Activation(activation) => {
                    behind.last_mut().into_iter().for_each(|all| all.push(*activation));
                }
            }
        }
        let start = start(&applied, layers, is_part)?;
        if let (0, [first, ..]) = (start, behind[0].as_slice()) {
            return Err(format!("{first} stands before its first layer"));
        }
        let behind = behind[start + 1..].iter().zip(layers);
        behind.map(|(all, layer)| single(all, &layer.name)).collect()
    }
}

/// The place of the first of the layers among those that are applied, in whose order they have to be.
fn start(applied: &[&Layer], layers: &[Layer], is_part: bool) -> Result<usize, String> {
    let is_applied = |layer: &&Layer| applied.iter().any(|other| other.name == layer.name);
    if let Some(idle) = layers.iter().find(|layer| !is_applied(layer)) {
        return Err(format!("`{}` is not applied", idle.name));
    }
    let start = applied.iter().position(|layer| layer.name == layers[0].name).unwrap_or_default();
    let same = |run: &[&Layer]| run.iter().copied().eq(layers);
    let run = applied.get(start..start + layers.len()).unwrap_or_default();
    if same(run) && (is_part || applied.len() == layers.len()) {
        return Ok(start);
    }
    let names: Vec<&str> = applied.iter().take(8).map(|layer| layer.name.as_str()).collect();
    let rest = if names.len() < applied.len() { ", and others" } else { "" };
    let is_same = layers.iter().map(|layer| layer.name.as_str()).eq(names.iter().copied());
    let bias = if is_same { ", with other biases" } else { "" };
    Err(format!("it applies {}{rest}{bias}", names.join(", then ")))
}

/// The one activation behind a layer, identity if there is none.
fn single(all: &[Activation], layer: &str) -> Result<Activation, String> {
    match all {
        [] => Ok(Activation::Identity),
        [one] => Ok(*one),
        [first, second, ..] => Err(format!("{first}, then {second} behind `{layer}`")),
    }
}

/// The activations of the code, or those that are stated, all of them if any is another.
fn agreed(mut behind: Vec<Activation>, request: &Request) -> Result<Settled, String> {
    let words: Vec<String> = behind.iter().map(|one| one.to_string()).collect();
    let words = words.join(", ");
    let last = behind.pop();
    let is_other = |stated: Option<Activation>, code: &[Activation]| {
        stated.is_some_and(|stated| code.iter().any(|&code| code != stated))
    };
    let others = [is_other(request.activation, &behind), is_other(request.output, last.as_slice())];
    behind.extend(last);
    let note = match (others, request.activation.and(request.output)) {
        ([false, false], _) => format!("its code applies {words} behind its layers"),
        (_, Some(_)) => format!(
            "as stated, while the code of the module applies {words} behind its layers, one after the other"
        ),
        ([hidden, _], None) => {
            return Err(format!(
                "{} is not what the code of this TorchScript module says: it applies {words} behind its layers, one \
                 after the other. Leave it out to have that, or state both --activation and --output to have them \
                 anyway",
                if hidden { "--activation" } else { "--output" }
            ));
        }
    };
    Ok(Settled { activations: Some(behind), note })
}
