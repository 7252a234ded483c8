//! A dense layer among named tensors, and the network that its name puts it in.

use super::names::split;
use super::source::Tensor;

/// The modules of a tianshou actor or critic that hold its layers: a body and a head.
const TIANSHOU: [&str; 2] = ["preprocess.model.model", "last.model"];

/// How a weight lies in its tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// `[outputs, inputs]`, as PyTorch has it.
    OutIn,
    /// `[inputs, outputs]`, as JAX has it.
    InOut,
}

/// A dense layer of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dense<'a> {
    /// What its tensors are called before `.weight` and `.bias`.
    pub(super) name: &'a str,
    /// Two dimensions.
    pub(super) weight: &'a Tensor,
    /// How the weight lies.
    pub(super) order: Order,
    /// `[outputs]`, where it has one.
    pub(super) bias: Option<&'a Tensor>,
}

impl<'a> Dense<'a> {
    /// Numbers that it takes.
    pub(super) fn inputs(&self) -> usize {
        self.weight.shape[usize::from(self.order == Order::OutIn)]
    }

    /// Numbers that it gives.
    pub(super) fn outputs(&self) -> usize {
        self.weight.shape[usize::from(self.order == Order::InOut)]
    }

    /// The network that the layer belongs to: what its name has before the layer's own part.
    pub(super) fn network(&self) -> &'a str {
        module(self.name)
    }
}

/// What a layer's name has before its own part.
pub(super) fn module(layer: &str) -> &str {
    let module = split(layer).0;
    let tianshou = TIANSHOU.iter().find_map(|part| module.strip_suffix(part));
    match tianshou {
        Some(before) if before.is_empty() || before.ends_with('.') => before.trim_end_matches('.'),
        _ => module,
    }
}
