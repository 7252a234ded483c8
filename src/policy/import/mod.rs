//! Policies from files of other programs: PyTorch, JAX, ONNX, safetensors, and texts of verification tools.
//!
//! Nothing in a file is executed, and no length in it decides how much memory is taken.

mod applied;
mod archive;
mod arrange;
mod array;
mod bearing;
mod calls;
mod checkpoint;
mod choice;
mod classes;
mod collect;
mod constants;
mod dense;
mod draft;
mod elementwise;
mod foreign;
mod form;
mod format;
mod front;
mod functional;
mod graph;
mod joined;
mod kind;
mod layers;
mod layouts;
mod legacy;
mod linear;
mod lost;
mod map;
mod names;
mod nnet;
mod norms;
mod onnx;
mod operations;
mod order;
mod parts;
mod pickle;
mod polar;
mod request;
mod said;
mod sb3;
mod script;
mod source;
mod spaces;
mod statistics;
mod text;
mod value;
mod walk;
mod weights;

use std::path::Path;

use crate::error::{Error, Result};
use crate::files;
use archive::Entries;
use format::Format;
pub use kind::Cast;
use request::Hints;
pub use request::{Imported, Origin, Request};
use source::Source;

/// Reads a network from a file of another program.
///
/// A checkpoint is a state dict, or containers with state dicts in them; where the layout of a library is
/// recognised, its layers, normalisers and defaults are taken. Else the layers of the only network are taken to
/// be applied one after the other, with what the request states between them and at the end. Of layers that the
/// request names, what it does not state is `relu` between them and `tanh` at the end (nothing at the end of a
/// `critic`). A graph or a text says what lies between its layers.
///
/// # Errors
/// [`Error::File`] saying what is damaged, not supported or not clear, and what to do;
/// [`Error::Invalid`] for a request that does not go with the file.
pub fn read(path: &Path, request: &Request) -> Result<Imported> {
    let bytes = files::read(path, files::ARCHIVE_BYTES).map_err(|e| Error::file(path, e))?;
    from_bytes(path, &bytes, request)
}

/// Reads a network from the content of the file `path`.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(path: &Path, bytes: &[u8], request: &Request) -> Result<Imported> {
    let refused = |problem: String| Error::file(path, problem);
    let format = Format::of(path, bytes).map_err(refused)?;
    match format {
        Format::Graph => {
            let found = graph::read(bytes, &request.networks, request.cast).map_err(refused)?;
            whole(found, &Request { networks: Vec::new(), ..request.clone() })
        }
        Format::Nnet => whole(nnet::read(bytes).map_err(refused)?, request),
        Format::Polar => whole(polar::read(bytes).map_err(refused)?, request),
        Format::Archive => from_archive(bytes, request).map_err(refused),
        Format::Pickle => tensors(checkpoint::open_pickle(bytes), request).map_err(refused),
        Format::Safetensors => tensors(foreign::open(bytes), request).map_err(refused),
    }
}

/// The network of a zip archive: a checkpoint, or one that stable-baselines3 has put into another archive.
fn from_archive(bytes: &[u8], request: &Request) -> std::result::Result<Imported, String> {
    match Entries::open(bytes)?.around("data.pkl") {
        Some(entries) => tensors(checkpoint::open(entries), request),
        None => {
            let sb3::Model { checkpoint, hints } = sb3::open(Entries::open(bytes)?)?;
            let inner = Entries::open(&checkpoint)?.around("data.pkl");
            let inner =
                inner.ok_or("no entry `data.pkl` in `policy.pth`: not written by torch.save")?;
            choice::policy(checkpoint::open(inner)?, request, &hints)
        }
    }
}

/// The network among named tensors.
fn tensors(
    source: std::result::Result<Source<'_>, String>,
    request: &Request,
) -> std::result::Result<Imported, String> {
    choice::policy(source?, request, &Hints::default())
}

/// The network of a file that says all about it, which a request may repeat but not change.
fn whole(found: Imported, request: &Request) -> Result<Imported> {
    if !request.networks.is_empty() {
        return Err(Error::invalid("network", "the file holds one network; leave it out"));
    }
    let layers = found.network.layers();
    let (last, hidden) =
        layers.split_last().map_or((None, layers), |(last, hidden)| (Some(last), hidden));
    let differs = |place: &str, stated: String, has: String| {
        Err(Error::invalid(place, format!("{stated} is stated, the file has {has}; leave it out")))
    };
    for (place, stated, layers) in [
        ("activation", request.activation, hidden),
        ("output", request.output, last.map_or(&[][..], std::slice::from_ref)),
    ] {
        if let Some(stated) = stated
            && let Some(other) = layers.iter().find(|layer| layer.activation != stated)
        {
            return differs(place, stated.name(), other.activation.name());
        }
    }
    Ok(found)
}
