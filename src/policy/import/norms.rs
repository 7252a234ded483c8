//! Norms and learned activations among named tensors: which they are, and what to do, since a state dict does not say
//! where they stand.

use super::names::{split, under};
use super::source::{Source, Tensor};

/// Beginnings of the keys of norms of JAX and others.
const NORMS: [(&str, &str); 4] = [
    ("LayerNorm", "a LayerNorm"),
    ("BatchNorm", "a BatchNorm"),
    ("RMSNorm", "an RMSNorm"),
    ("GroupNorm", "a GroupNorm"),
];

/// The refusal of a tensor that is a part of a norm or of a learned activation; none if it is not known to be one.
pub(super) fn refusal(source: &Source<'_>, tensor: &Tensor) -> Option<String> {
    let (module, _) = split(&tensor.name);
    let what = kind(source, tensor)?;
    Some(format!(
        "`{module}` is {what} (`{}` of shape {:?}), and no dense layer; the file does not say whether it stands before or \
         behind an activation. An ONNX export keeps it where it is: torch.onnx.export(policy, torch.zeros(1, INPUTS), \
         'policy.onnx', external_data=False)",
        tensor.name, tensor.shape
    ))
}

/// What it is a part of, in words.
fn kind(source: &Source<'_>, tensor: &Tensor) -> Option<&'static str> {
    let (module, part) = split(&tensor.name);
    let has = |part: &str| source.tensor(&under(module, part)).is_some();
    let named = NORMS.iter().find(|(key, _)| split(module).1.starts_with(key));
    if let Some((_, what)) = named.filter(|_| ["scale", "weight", "bias"].contains(&part)) {
        return Some(what);
    }
    let own = has("weight") && ["weight", "bias"].contains(&part);
    match tensor.shape.as_slice() {
        [_] if own && has("running_mean") => Some("a BatchNorm"),
        [_] if own && has("bias") => Some("a LayerNorm or GroupNorm"),
        [1] if own => Some("a PReLU"),
        [_] if own => Some("an RMSNorm, a PReLU, or a norm without a bias"),
        _ => None,
    }
}
