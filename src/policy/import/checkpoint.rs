//! PyTorch checkpoints: a zip archive with a pickle of names and the numbers of each storage.

use std::collections::HashSet;
use std::io::Cursor;

use super::kind::{Cast, FloatReader, Kind};
use super::pickle::{self, Unpickled};
use super::value::{Pickle, Value, View};
use crate::files::Archive;

/// How deep dictionaries may lie in one another.
const DEEPEST: usize = 8;
/// Most entries of all dictionaries, counted as often as they are reached.
const MOST_ENTRIES: usize = 1 << 17;
/// Longest key of a dictionary, bytes.
const LONGEST_KEY: usize = 256;

/// A checkpoint that numbers are read from.
pub(super) struct Checkpoint<'a> {
    archive: Archive<Cursor<&'a [u8]>>,
    entries: Vec<String>,
    /// Where the entries lie, `archive/` in most files.
    folder: String,
}

/// A checkpoint and what is in it.
pub(super) struct Opened<'a> {
    pub(super) checkpoint: Checkpoint<'a>,
    /// Its tensors in the order of the file, which is that of the modules in a state dict.
    pub(super) tensors: Vec<Tensor>,
}

/// A tensor of a checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tensor {
    /// The keys on the way to it, joined by dots.
    pub(super) name: String,
    /// Length of each dimension.
    pub(super) shape: Vec<usize>,
    strides: Vec<usize>,
    offset: usize,
    kind: Kind,
    key: String,
}

impl<'a> Checkpoint<'a> {
    /// The checkpoint in the archive `bytes`, with its tensors.
    ///
    /// # Errors
    /// A sentence about damage, a checkpoint of another sort, or a pickle that asks for more than
    /// tensors.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Opened<'a>, String> {
        let damaged = |e| format!("not a whole checkpoint ({e})");
        let archive = Archive::open(Cursor::new(bytes), bytes.len() as u64).map_err(damaged)?;
        let entries = archive.names().map_err(damaged)?;
        let folder = entries.iter().find_map(|name| name.strip_suffix("data.pkl"));
        let folder = folder.ok_or("no entry `data.pkl`: not written by torch.save")?.to_owned();
        let mut checkpoint = Self { archive, entries, folder };
        if checkpoint.index("constants.pkl").is_some() {
            return Err("a TorchScript module, which holds code; save its tensors alone: \
                        torch.save(torch.jit.load(FILE).state_dict(), OTHER)"
                .to_owned());
        }
        if checkpoint.index("byteorder").is_some() && checkpoint.read("byteorder")? != b"little" {
            return Err("saved with the most significant byte first; load and save it again on a \
                        little-endian machine"
                .to_owned());
        }
        let text = checkpoint.read("data.pkl")?;
        let Unpickled { pickle, root } = pickle::read(&text)?;
        let tensors = tensors(&pickle, root)?;
        Ok(Opened { checkpoint, tensors })
    }

    /// The numbers of `tensor`, its last index the fastest.
    ///
    /// # Errors
    /// A sentence about numbers that are missing, damaged, or no f32 if `cast` does not allow it.
    pub(super) fn numbers(&mut self, tensor: &Tensor, cast: Cast) -> Result<Vec<f32>, String> {
        let FloatReader { size, number } = tensor.kind.reader(cast)?;
        let bytes = self.read(&format!("data/{}", tensor.key))?;
        let elements = bytes.len() / size;
        if !tensor.fits(elements) {
            let Tensor { shape, strides, offset, .. } = tensor;
            return Err(format!(
                "shape {shape:?} with strides {strides:?} from element {offset} on does not fit \
                 the {elements} numbers of its storage; clone() expanded tensors before saving"
            ));
        }
        let at = |element: usize| number(&bytes[size * element..]);
        Ok(tensor.elements().into_iter().map(at).collect())
    }

    /// Number of the entry `name`.
    fn index(&self, name: &str) -> Option<usize> {
        let is = |entry: &String| entry.strip_prefix(&self.folder) == Some(name);
        self.entries.iter().position(is)
    }

    /// Content of the entry `name`.
    fn read(&mut self, name: &str) -> Result<Vec<u8>, String> {
        let index = self.index(name).ok_or_else(|| format!("no entry `{name}`"))?;
        self.archive.read(index).map_err(|problem| format!("entry `{name}`: {problem}"))
    }
}

impl Tensor {
    /// Whether all indices lie within a storage of `elements`, and are no more than these.
    fn fits(&self, elements: usize) -> bool {
        if self.shape.len() != self.strides.len() || self.shape.contains(&0) {
            return false;
        }
        let count = self.shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length));
        let dimensions = self.shape.iter().zip(&self.strides);
        let last = dimensions.into_iter().try_fold(self.offset, |last, (&length, &stride)| {
            last.checked_add(stride.checked_mul(length.saturating_sub(1))?)
        });
        count.is_some_and(|count| count <= elements) && last.is_some_and(|last| last < elements)
    }

    /// The elements of the storage in the order of the tensor's indices.
    fn elements(&self) -> Vec<usize> {
        let dimensions = self.shape.iter().zip(&self.strides);
        dimensions.fold(vec![self.offset], |starts, (&length, &stride)| {
            let row = |start: usize| (0..length).map(move |i| start + i * stride);
            starts.into_iter().flat_map(row).collect()
        })
    }
}

/// All tensors of the dictionaries in `root`, with the keys that lead to them.
fn tensors(pickle: &Pickle<'_>, root: Value<'_>) -> Result<Vec<Tensor>, String> {
    let Value::Dict(root) = root else {
        return Err(
            "no dictionary of tensors; save one: torch.save(module.state_dict(), FILE)".to_owned()
        );
    };
    let mut found = Vec::new();
    collect(pickle, root, &mut Vec::new(), &mut 0, &mut found)?;
    let mut names = HashSet::new();
    match found.iter().find(|tensor: &&Tensor| !names.insert(tensor.name.as_str())) {
        Some(tensor) => Err(format!("two tensors are called `{}`", tensor.name)),
        None => Ok(found),
    }
}

/// Adds the tensors of the dictionary number `dict`, which lies at `path`; `seen` counts entries.
fn collect(
    pickle: &Pickle<'_>,
    dict: usize,
    path: &mut Vec<String>,
    seen: &mut usize,
    found: &mut Vec<Tensor>,
) -> Result<(), String> {
    if path.len() == DEEPEST {
        return Err(format!("dictionaries within one another, {DEEPEST} deep and more"));
    }
    for &(key, value) in &pickle.dicts[dict] {
        *seen += 1;
        if *seen > MOST_ENTRIES {
            return Err(format!("more than {MOST_ENTRIES} entries in its dictionaries"));
        }
        path.push(match key {
            Value::Text(text) if text.len() > LONGEST_KEY => {
                return Err(format!("a key of {} bytes", text.len()));
            }
            Value::Text(text) => text.to_owned(),
            Value::Int(number) => number.to_string(),
            _ => continue,
        });
        match value {
            Value::Dict(inner) => collect(pickle, inner, path, seen, found)?,
            Value::Tensor(number) => {
                found.push(tensor(path.join("."), &pickle.tensors[number]));
            }
            _ => {}
        }
        path.pop();
    }
    Ok(())
}

/// The tensor `name`.
fn tensor(name: String, view: &View<'_>) -> Tensor {
    let View { storage, offset, shape, strides } = view.clone();
    Tensor { name, shape, strides, offset, kind: storage.kind, key: storage.key.to_owned() }
}
