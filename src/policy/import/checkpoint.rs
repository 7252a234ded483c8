//! Checkpoints of PyTorch: a zip archive with a pickle of names and the numbers of each storage.

use super::archive::Entries;
use super::pickle;
use super::source::Source;
use super::{collect, legacy, script};

/// Longest pickle beside its storages, bytes: some 100,000 tensors.
const LONGEST: usize = 1 << 24;

/// The tensors in the archive whose entries these are; of a compiled module, the tensors alone.
///
/// # Errors
/// A sentence about damage, a checkpoint of another sort, or a pickle that is no policy's.
pub(super) fn open(mut entries: Entries<'_>) -> Result<Source<'_>, String> {
    if entries.has("byteorder") && entries.read("byteorder")? != b"little" {
        return Err("saved with the most significant byte first; load and save it again on a \
                    little-endian machine"
            .to_owned());
    }
    let text = entries.read("data.pkl")?;
    if text.len() > LONGEST {
        let length = text.len();
        return Err(format!("{length} bytes of pickle; no state dict has more than {LONGEST}"));
    }
    let compiled = entries.has("constants.pkl");
    let source = collect::source(pickle::read(&text)?)?;
    if compiled && source.tensors.is_empty() {
        return Err("a TorchScript module without tensors of its own, as a frozen one is; save the module's \
                    state dict before it is compiled: torch.save(module.state_dict(), FILE)"
            .to_owned());
    }
    let script = if compiled { Some(script::read(&mut entries, &source.flags)?) } else { None };
    Ok(Source { entries: Some(entries), script, ..source })
}

/// The tensors of a pickle that is a file of its own: JAX's, or PyTorch's before 1.6.
///
/// # Errors
/// As [`open`].
pub(super) fn open_pickle(bytes: &[u8]) -> Result<Source<'_>, String> {
    match legacy::is_one(bytes) {
        true => legacy::open(bytes),
        false => collect::source(pickle::read(bytes)?),
    }
}
