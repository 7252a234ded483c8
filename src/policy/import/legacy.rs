//! Checkpoints of PyTorch before 1.6: pickles one after the other, and then the storages.

use std::collections::HashMap;

use super::collect;
use super::kind::Kind;
use super::pickle::{self, Unpickled};
use super::source::{Place, Source};
use super::value::Value;

/// The first pickle, as a whole: a long integer that says what the file is.
const MAGIC: &[u8] = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.";
/// Pickles before that of the tensors: the magic number, a version, and sizes of numbers.
const BEFORE: usize = 3;

/// Whether `bytes` are a checkpoint of this format.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// The tensors of a checkpoint of this format.
///
/// # Errors
/// A sentence about damage, or a pickle that is no policy's.
pub(super) fn open(bytes: &[u8]) -> Result<Source<'_>, String> {
    let mut rest = bytes;
    for _ in 0..BEFORE {
        rest = &rest[pickle::read(rest)?.length..];
    }
    let tensors = pickle::read(rest)?;
    rest = &rest[tensors.length..];
    let list = pickle::read(rest)?;
    let keys = keys(&list)?;
    let kinds = tensors.pickle.storages.clone();
    let source = collect::source(tensors)?;
    with_storages(source, &keys, &kinds, &rest[list.length..])
}

/// The names of the storages, in the order in which they follow.
fn keys<'a>(list: &Unpickled<'a>) -> Result<Vec<&'a str>, String> {
    let Value::List(number) = list.root else {
        return Err("no list of storages after its tensors".to_owned());
    };
    let key = |item: &Value<'a>| if let Value::Text(key) = item { Some(*key) } else { None };
    let keys = list.pickle.lists[number].iter().map(key).collect::<Option<_>>();
    keys.ok_or_else(|| "a storage whose name is no text".to_owned())
}

/// The same tensors with the storages that `bytes` hold one after the other.
fn with_storages<'a>(
    mut source: Source<'a>,
    keys: &[&str],
    kinds: &HashMap<&str, Kind>,
    bytes: &[u8],
) -> Result<Source<'a>, String> {
    let (mut runs, mut rest) = (HashMap::new(), bytes);
    for key in keys {
        let kind = kinds.get(key).ok_or_else(|| format!("a storage `{key}` that no tensor has"))?;
        let (run, left) =
            storage(rest, kind.size()).ok_or_else(|| format!("storage `{key}`: cut off"))?;
        rest = left;
        runs.insert(*key, source.runs.len());
        source.runs.push(run.to_vec());
    }
    for tensor in &mut source.tensors {
        if let Place::Entry(key) = &tensor.place {
            let run = runs.get(key.as_str());
            let run = run.ok_or_else(|| format!("`{}`: no storage `{key}`", tensor.name))?;
            tensor.place = Place::Run(*run);
        }
    }
    Ok(source)
}

/// The storage that `bytes` begin with, numbers of `size` bytes after their count, and what follows it.
fn storage(bytes: &[u8], size: usize) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_first_chunk()?;
    let count = usize::try_from(u64::from_le_bytes(*count)).ok()?;
    rest.split_at_checked(count.checked_mul(size)?)
}
