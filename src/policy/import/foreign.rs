//! Safetensors files of other programs: tensors of any name, sorted as their numbers say.

use safetensors::SafeTensors;

use super::kind::Kind;
use super::names::compare;
use super::source::{Source, Tensor};
use crate::policy::Mlp;

/// The tensors of a safetensors file.
///
/// # Errors
/// A sentence about damage, or a file that is a policy file.
pub(super) fn open(bytes: &[u8]) -> Result<Source<'_>, String> {
    if Mlp::from_bytes(bytes).is_ok() {
        return Err("a policy file already, which needs no import".to_owned());
    }
    let file = SafeTensors::deserialize(bytes);
    let file = file.map_err(|e| format!("not a whole safetensors file ({e})"))?;
    let mut source = Source::default();
    for (name, view) in file.iter() {
        let kind = Kind::of_safetensors(view.dtype());
        let tensor = Tensor::plain(name.to_owned(), view.shape().to_vec(), kind, source.runs.len());
        source.tensors.push(tensor);
        source.runs.push(view.data().to_vec());
    }
    // The file has no order of its own.
    source.tensors.sort_by(|a, b| compare(&a.name, &b.name));
    Ok(source)
}
