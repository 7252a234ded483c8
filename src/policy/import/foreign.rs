//! Safetensors files of other programs: tensors of any name, sorted as their numbers say.

use safetensors::SafeTensors;

use super::kind::Kind;
use super::names::compare;
use super::said;
use super::source::{Plain, Said, Source, Tensor};
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
        let (name, text) = (key.to_owned(), text.to_owned());
        match said::amount(&text) {
            Some(amount) => source.plain.push(Plain { name, amount }),
            None => source.said.push(Said { name, text }),
        }
    }
    source.plain.sort_unstable_by(|a, b| a.name.cmp(&b.name));
    source.said.sort_unstable_by(|a, b| a.name.cmp(&b.name));
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
