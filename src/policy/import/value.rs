//! What a pickle of tensors is made of: values, and the containers that hold them.

use std::collections::HashMap;

use super::kind::Kind;

/// A value as far as it matters for a network. Texts lie in the pickle, containers in [`Pickle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    /// A string.
    Text(&'a str),
    /// An integer of at most 64 bits.
    Int(i64),
    /// A longer one.
    Long,
    /// A float.
    Float,
    /// A truth value.
    Truth(bool),
    /// The name of a class or a function.
    Name(Name<'a>),
    /// Number of a tuple.
    Tuple(usize),
    /// Number of a list or a set.
    List(usize),
    /// Number of a dictionary.
    Dict(usize),
    /// Number of a run of bytes.
    Bytes(usize),
    /// Numbers outside of the pickle.
    Storage(Storage<'a>),
    /// Number of a kind of numbers of NumPy, which is set up after it was made.
    Type(usize),
    /// Number of a tensor or an array.
    Tensor(usize),
    /// Number of an object of a class that is not known.
    Object(usize),
    /// What no network is made of: None.
    Other,
}

/// A name that Python would look up, and nobody here does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Name<'a> {
    /// The module.
    pub(super) module: &'a str,
    /// The name in it.
    pub(super) name: &'a str,
}

impl std::fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.module, self.name)
    }
}

/// A run of numbers of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Storage<'a> {
    /// What the numbers are.
    pub(super) kind: Kind,
    /// Where they are.
    pub(super) place: Place<'a>,
}

/// Where the numbers of a tensor are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place<'a> {
    /// In the entry of this name.
    Entry(&'a str),
    /// In the run of bytes of this number.
    Bytes(usize),
}

/// A tensor as a view of a storage.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct View<'a> {
    /// The storage.
    pub(super) storage: Storage<'a>,
    /// Element of the storage that the tensor begins at.
    pub(super) offset: usize,
    /// Length of each dimension.
    pub(super) shape: Vec<usize>,
    /// Elements of the storage from one index to the next, for each dimension.
    pub(super) strides: Vec<usize>,
}

/// An object that was not made: what it would have been made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Object<'a> {
    /// The class or function that would have made it.
    pub(super) maker: Name<'a>,
    /// Its arguments, its attributes and what was put into it.
    pub(super) parts: Vec<Value<'a>>,
    /// The array that it is, where its numbers came after it.
    pub(super) array: Option<Value<'a>>,
}

/// A pickle that has been read.
#[derive(Debug, Default)]
pub(super) struct Pickle<'a> {
    /// Entries of each dictionary, in the order in which they were put in.
    pub(super) dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    /// Tensors and arrays.
    pub(super) tensors: Vec<View<'a>>,
    /// Items of each tuple.
    pub(super) tuples: Vec<Vec<Value<'a>>>,
    /// Items of each list and set.
    pub(super) lists: Vec<Vec<Value<'a>>>,
    /// Runs of bytes.
    pub(super) bytes: Vec<Vec<u8>>,
    /// Runs of bytes that were written as a text, by the place of the text in memory.
    pub(super) encoded: HashMap<usize, usize>,
    /// Kinds of numbers of NumPy.
    pub(super) kinds: Vec<Kind>,
    /// Kinds of the storages that it refers to.
    pub(super) storages: HashMap<&'a str, Kind>,
    /// Objects that nobody made.
    pub(super) objects: Vec<Object<'a>>,
}

impl<'a> Pickle<'a> {
    /// A value that was remembered, maybe before the numbers of the array that it is were there.
    pub(super) fn recalled(&self, value: Value<'a>) -> Value<'a> {
        match value {
            Value::Object(number) => self.objects[number].array.unwrap_or(value),
            _ => value,
        }
    }
}

impl Value<'_> {
    /// An integer, least byte first, in two's complement.
    pub(super) fn long(bytes: &[u8]) -> Self {
        let negative = bytes.last().is_some_and(|&byte| byte >= 0x80);
        let mut word = [if negative { 0xff } else { 0 }; 8];
        match word.get_mut(..bytes.len()) {
            Some(low) => {
                low.copy_from_slice(bytes);
                Self::Int(i64::from_le_bytes(word))
            }
            None => Self::Long,
        }
    }
}

impl<'a> Pickle<'a> {
    /// Adds the arguments with names of the call that gives `value` to what it is made of.
    ///
    /// # Errors
    /// A sentence about those of something whose arguments have none.
    pub(super) fn add_named(&mut self, value: Value<'a>, named: Value<'a>) -> Result<(), String> {
        match (value, named) {
            (_, Value::Other) => Ok(()),
            (_, Value::Dict(dict)) if self.dicts[dict].is_empty() => Ok(()),
            (Value::Object(number), Value::Dict(_)) => {
                self.objects[number].parts.push(named);
                Ok(())
            }
            _ => Err("a call with named arguments of what takes none".to_owned()),
        }
    }

    /// Refuses attributes of a tensor or a container, but for those by which PyTorch notes versions.
    ///
    /// # Errors
    /// The refusal, with the name of the first.
    pub(super) fn refuse_attributes(&self, state: Value<'_>) -> Result<(), String> {
        let key = match state {
            // One for attributes and one for slots.
            Value::Tuple(both) => self.tuples[both].iter().find_map(|part| self.attribute(*part)),
            state => self.attribute(state),
        };
        key.map_or(Ok(()), |key| {
            Err(format!(
                "a tensor or dictionary with a state of its own, the attribute `{key}` or other numbers, which would be lost; save \
                 what it is under a key"
            ))
        })
    }

    /// The first attribute of a state; what is no dictionary of them may be anything.
    fn attribute(&self, state: Value<'_>) -> Option<&'a str> {
        let dict = match state {
            Value::Dict(dict) => dict,
            Value::Other => return None,
            _ => return Some("?"),
        };
        self.dicts[dict].iter().find_map(|(key, _)| match key {
            Value::Text("_metadata") => None,
            Value::Text(key) => Some(*key),
            _ => Some("?"),
        })
    }
}
