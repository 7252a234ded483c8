//! What a pickle of tensors is made of: values, the names that it may use, and its containers.

use super::kind::Kind;

/// A value as far as it matters for a network. Texts lie in the pickle, containers in [`Pickle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    /// A string.
    Text(&'a str),
    /// An integer of at most 64 bits.
    Int(i64),
    /// A name that may be used.
    Global(Global),
    /// Number of a tuple.
    Tuple(usize),
    /// Number of a dictionary.
    Dict(usize),
    /// Numbers in an entry of their own.
    Storage(Storage<'a>),
    /// Number of a tensor.
    Tensor(usize),
    /// What no network is made of: None, a truth value, a float, a list, a long integer.
    Other,
}

/// The names that a state dict may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Global {
    /// `collections.OrderedDict`: a dictionary.
    OrderedDict,
    /// `torch._utils._rebuild_tensor_v2`: a tensor as a view of a storage.
    Tensor,
    /// `torch._utils._rebuild_parameter`: the tensor that is its first argument.
    Parameter,
    /// `torch.FloatStorage` and the like.
    Storage(Kind),
}

impl Global {
    /// The name `module.name`, if it may be used.
    ///
    /// # Errors
    /// The refusal of any other name.
    pub(super) fn find(module: &str, name: &str) -> Result<Self, String> {
        let storage = Kind::of_storage(name).filter(|_| module == "torch").map(Self::Storage);
        let known = match (module, name) {
            ("collections", "OrderedDict") => Some(Self::OrderedDict),
            ("torch._utils", "_rebuild_tensor_v2") => Some(Self::Tensor),
            ("torch._utils", "_rebuild_parameter") => Some(Self::Parameter),
            _ => storage,
        };
        known.ok_or_else(|| {
            format!(
                "names `{module}.{name}`, which no state dict needs; nothing was executed. Save \
                 tensors alone: torch.save(module.state_dict(), FILE)"
            )
        })
    }
}

/// A run of numbers of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Storage<'a> {
    /// What the numbers are.
    pub(super) kind: Kind,
    /// Name of the entry that holds them.
    pub(super) key: &'a str,
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

/// A pickle that has been read.
#[derive(Debug, Default)]
pub(super) struct Pickle<'a> {
    /// Entries of each dictionary, in the order in which they were put in.
    pub(super) dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    /// Tensors.
    pub(super) tensors: Vec<View<'a>>,
    /// Items of each tuple.
    pub(super) tuples: Vec<Vec<Value<'a>>>,
}
