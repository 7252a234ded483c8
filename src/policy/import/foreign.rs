//! Safetensors files of other programs: tensors of any name, sorted as their numbers say.

use safetensors::SafeTensors;

use super::kind::Kind;
use super::names::compare;
use super::source::{Source, Tensor};
use crate::policy::Mlp;

/// The entry of the metadata by which programs say who wrote a file.
const FORMAT: &str = "format";

/// Entries of the metadata of policy files, of which each has one.
const OWN: [&str; 2] = ["activation", "activations"];

/// The tensors of a safetensors file.
///
/// # Errors
/// A sentence about damage, or a file that is a policy file.
pub(super) fn open(bytes: &[u8]) -> Result<Source<'_>, String> {
    let damaged = |e| format!("not a whole safetensors file ({e})");
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
    let file = SafeTensors::deserialize(bytes).map_err(damaged)?;
    let says = |key: &str| header.metadata().as_ref().is_some_and(|said| said.contains_key(key));
    match Mlp::from_bytes(bytes) {
        Ok(_) => return Err("a policy file already, which needs no import".to_owned()),
        // Read as the file of another program, it would lose what its metadata says.
        Err(problem) if OWN.into_iter().any(says) && file.tensor("layers.0.weight").is_ok() => {
            return Err(format!("a policy file already, which is damaged: {problem}"));
        }
        Err(_) => {}
    }
    let mut source = Source::default();
    for (key, text) in header.metadata().iter().flatten().filter(|(key, _)| *key != FORMAT) {
        let to = if is_numbers(text) { &mut source.plain } else { &mut source.said };
        to.push(key.to_owned());
    }
    source.plain.sort_unstable();
    source.said.sort_unstable();
    // Haiku joins the names of modules by slashes.
    let dotted = file.names().iter().any(|name| name.contains('.'));
    for (name, view) in file.iter() {
        let kind = Kind::of_safetensors(view.dtype());
        let name = if dotted { name.to_owned() } else { name.replace('/', ".") };
        let tensor = Tensor::plain(name, view.shape().to_vec(), kind, source.runs.len());
        source.tensors.push(tensor);
        source.runs.push(view.data().to_vec());
    }
    // The file has no order of its own.
    source.tensors.sort_by(|a, b| compare(&a.name, &b.name));
    Ok(source)
}

/// Whether a text is a number, or a list of numbers in brackets or without.
fn is_numbers(text: &str) -> bool {
    let inside = text.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']);
    let mut words = inside.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let first = words.next();
    first.into_iter().chain(words).all(|word| word.parse::<f64>().is_ok()) && first.is_some()
}
