//! Dense layers among named tensors, the networks that they form, and which of them is meant.

use std::collections::{HashMap, HashSet};

use super::checkpoint::Tensor;

/// Most layers of a network: layers may share their numbers, memory does not.
pub(super) const MOST_LAYERS: usize = 64;

/// The modules of a tianshou actor or critic that hold its layers: a body and a head.
const TIANSHOU: [&str; 2] = ["preprocess.model.model", "last.model"];
/// Most networks that a message lists.
const MOST_LISTED: usize = 40;

/// A dense layer of a checkpoint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dense<'a> {
    /// What its tensors are called before `.weight` and `.bias`.
    pub(super) name: &'a str,
    /// `[outputs, inputs]`.
    pub(super) weight: &'a Tensor,
    /// `[outputs]`, where it has one.
    pub(super) bias: Option<&'a Tensor>,
}

impl<'a> Dense<'a> {
    /// Columns of the weight.
    pub(super) fn inputs(&self) -> usize {
        self.weight.shape[1]
    }

    /// Rows of the weight.
    pub(super) fn outputs(&self) -> usize {
        self.weight.shape[0]
    }

    /// The network that the layer belongs to: what its name has before the layer's own part.
    fn network(&self) -> &'a str {
        let module = self.name.rsplit_once('.').map_or("", |(module, _)| module);
        let tianshou = TIANSHOU.iter().find_map(|part| module.strip_suffix(part));
        match tianshou {
            Some(before) if before.is_empty() || before.ends_with('.') => {
                before.trim_end_matches('.')
            }
            _ => module,
        }
    }
}

/// Names of the tensors that are no part of the layers `chosen`; those of no dense layer first, as
/// the statistics that observations are normalised with.
pub(super) fn left_out(tensors: &[Tensor], chosen: &[Dense<'_>]) -> Vec<String> {
    let parts = |layers: &[Dense<'_>]| -> HashSet<String> {
        let tensors = layers.iter().flat_map(|layer| [Some(layer.weight), layer.bias]);
        tensors.flatten().map(|tensor| tensor.name.clone()).collect()
    };
    let (used, of_layers) = (parts(chosen), parts(&dense(tensors)));
    let names = tensors.iter().map(|tensor| tensor.name.clone());
    let mut left: Vec<String> = names.filter(|name| !used.contains(name)).collect();
    left.sort_by_key(|name| of_layers.contains(name));
    left
}

/// The layers of the networks `asked`, one after the other; of the only network if none is.
///
/// # Errors
/// A sentence that lists the networks of the file if the choice is not clear, names a tensor that
/// no dense layer has, or a layer that does not follow on the one before.
pub(super) fn choose<'a>(
    tensors: &'a [Tensor],
    asked: &[String],
) -> Result<Vec<Dense<'a>>, String> {
    let layers = dense(tensors);
    if layers.is_empty() {
        return Err(format!(
            "no dense layer among its {} tensors: none is called `.weight` and has the shape \
             [out, in]",
            tensors.len()
        ));
    }
    let chosen = match asked {
        [] => pick(tensors, &layers, only(&layers)?, starts_with)?,
        _ => named(tensors, &layers, asked)?,
    };
    if chosen.len() > MOST_LAYERS {
        return Err(format!("{} layers; a network has at most {MOST_LAYERS}", chosen.len()));
    }
    chosen.iter().try_for_each(check_bias)?;
    chosen.windows(2).try_for_each(|pair| check_pair(&pair[0], &pair[1]))?;
    Ok(chosen)
}

/// The dense layers: weights of two dimensions, with their biases.
fn dense(tensors: &[Tensor]) -> Vec<Dense<'_>> {
    let of = |tensor| Some((layer_of(tensor, "bias")?, tensor));
    let biases: HashMap<&str, &Tensor> = tensors.iter().filter_map(of).collect();
    let layer = |weight| {
        let name = layer_of(weight, "weight").filter(|_| weight.shape.len() == 2)?;
        Some(Dense { name, weight, bias: biases.get(name).copied() })
    };
    tensors.iter().filter_map(layer).collect()
}

/// The layer whose `part` the tensor is.
fn layer_of<'a>(tensor: &'a Tensor, part: &str) -> Option<&'a str> {
    let before = tensor.name.strip_suffix(part)?;
    if before.is_empty() { Some(before) } else { before.strip_suffix('.') }
}

/// The name of the only network.
fn only<'a>(layers: &[Dense<'a>]) -> Result<&'a str, String> {
    match networks(layers).as_slice() {
        [(name, _)] => Ok(name),
        several => Err(format!(
            "{} networks; name the one that is meant with --network:{}",
            several.len(),
            listing(several)
        )),
    }
}

/// The layers of the networks `asked`.
fn named<'a>(
    tensors: &'a [Tensor],
    layers: &[Dense<'a>],
    asked: &[String],
) -> Result<Vec<Dense<'a>>, String> {
    let each = asked.iter().map(|prefix| {
        let begins = layers.iter().any(|layer| starts_with(layer.name, prefix));
        let rule = if begins { starts_with } else { holds };
        let chosen = pick(tensors, layers, prefix, rule)?;
        let several = networks(&chosen);
        match several.len() {
            0 => {
                let listing = listing(&networks(layers));
                Err(format!("no dense layer under `{prefix}`; it has the networks:{listing}"))
            }
            1 => Ok(chosen),
            _ => {
                let listing = listing(&several);
                Err(format!("`{prefix}` may be one of several networks; name one:{listing}"))
            }
        }
    });
    Ok(each.collect::<Result<Vec<_>, _>>()?.concat())
}

/// Whether `name` lies under `prefix`.
fn starts_with(name: &str, prefix: &str) -> bool {
    let rest = name.strip_prefix(prefix);
    prefix.is_empty() || rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Whether some keys of `name`, one after the other, are those of `keys`.
fn holds(name: &str, keys: &str) -> bool {
    format!(".{name}.").contains(&format!(".{keys}."))
}

/// The layers that lie under `prefix`, which must be all that lies there.
fn pick<'a>(
    tensors: &'a [Tensor],
    layers: &[Dense<'a>],
    prefix: &str,
    rule: fn(&str, &str) -> bool,
) -> Result<Vec<Dense<'a>>, String> {
    let chosen = layers.iter().filter(|layer| rule(layer.name, prefix));
    let chosen: Vec<Dense<'a>> = chosen.copied().collect();
    let known = chosen.iter().flat_map(|layer| [Some(layer.weight), layer.bias]).flatten();
    let known: HashSet<&str> = known.map(|tensor| tensor.name.as_str()).collect();
    let mut under = tensors.iter().filter(|tensor| rule(&tensor.name, prefix));
    match under.find(|tensor| !known.contains(tensor.name.as_str())) {
        Some(Tensor { name, shape, .. }) if !chosen.is_empty() => Err(format!(
            "`{name}` of shape {shape:?} is no part of a dense layer, so this is not a plain \
             network; if it does not bear on the output, give --network the prefixes of its \
             layers, separated by commas"
        )),
        _ => Ok(chosen),
    }
}

/// The networks that the layers form, in the order of the file.
fn networks<'a>(layers: &[Dense<'a>]) -> Vec<(&'a str, Vec<Dense<'a>>)> {
    let mut numbers = HashMap::new();
    let mut found: Vec<(&str, Vec<Dense<'_>>)> = Vec::new();
    for layer in layers {
        let number = *numbers.entry(layer.network()).or_insert_with(|| {
            found.push((layer.network(), Vec::new()));
            found.len() - 1
        });
        found[number].1.push(*layer);
    }
    found
}

/// A line per network: its name and widths.
fn listing(networks: &[(&str, Vec<Dense<'_>>)]) -> String {
    let line = |(name, layers): &(&str, Vec<Dense<'_>>)| {
        let name = if name.is_empty() { "(no prefix)" } else { name };
        if layers.windows(2).all(|pair| pair[0].outputs() == pair[1].inputs()) {
            let outputs: String = layers.iter().map(|l| format!("-{}", l.outputs())).collect();
            return format!("\n  {name}  {}{outputs}", layers[0].inputs());
        }
        let shapes: Vec<String> = layers.iter().map(|l| format!("{:?}", l.weight.shape)).collect();
        format!("\n  {name}  not one after the other: {}", shapes.join(" "))
    };
    let more = match networks.len().saturating_sub(MOST_LISTED) {
        0 => String::new(),
        more => format!("\n  and {more} more"),
    };
    networks.iter().take(MOST_LISTED).map(line).collect::<String>() + &more
}

/// Refuses a bias that is not one number per output.
fn check_bias(layer: &Dense<'_>) -> Result<(), String> {
    match layer.bias {
        Some(bias) if bias.shape != [layer.outputs()] => Err(format!(
            "`{}` has shape {:?}, `{}` has {} rows",
            bias.name,
            bias.shape,
            layer.weight.name,
            layer.outputs()
        )),
        _ => Ok(()),
    }
}

/// Refuses a layer that does not follow on the one before: by its width, or by its number.
fn check_pair(before: &Dense<'_>, after: &Dense<'_>) -> Result<(), String> {
    let (first, second) = (&before.weight.name, &after.weight.name);
    if before.outputs() != after.inputs() {
        return Err(format!(
            "`{second}` takes {} numbers, `{first}` before it gives {}",
            after.inputs(),
            before.outputs()
        ));
    }
    match (number(before.name), number(after.name)) {
        (Some((module, i)), Some((same, j))) if module == same && i >= j => Err(format!(
            "`{first}` stands before `{second}` in the file; the order of the layers is not clear"
        )),
        _ => Ok(()),
    }
}

/// The module of a numbered layer, and its number.
fn number(layer: &str) -> Option<(&str, u64)> {
    let (module, number) = layer.rsplit_once('.').unwrap_or(("", layer));
    Some((module, number.parse().ok()?))
}
