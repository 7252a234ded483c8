//! Dense layers among named tensors, the networks that they form, and which of them is meant.

use std::collections::{HashMap, HashSet};

use super::bearing::{Bearing, Known, gives_deviations, is_memory, is_parametrized};
use super::dense::{Dense, Order};
use super::names::{compare, holds, is_head, numbered, split, starts_with};
use super::source::{Source, Tensor};
use super::{norms, order};

/// What the weights and biases of a library are called, and how the weights lie.
const PARTS: [(&str, &str, Order); 3] =
    [("weight", "bias", Order::OutIn), ("kernel", "bias", Order::InOut), ("w", "b", Order::InOut)];
/// Most networks that a message lists.
const MOST_LISTED: usize = 40;

/// The dense layers of a file: weights of two dimensions, with their biases.
pub(super) fn dense<'a>(source: &'a Source<'_>) -> Vec<Dense<'a>> {
    let tensors: HashMap<&str, &Tensor> =
        source.tensors.iter().map(|tensor| (tensor.name.as_str(), tensor)).collect();
    let layer = |weight: &'a Tensor| {
        let (name, part) = split(&weight.name);
        let (_, bias, order) = *PARTS.iter().find(|(weight, ..)| *weight == part)?;
        let bias = if name.is_empty() { bias.to_owned() } else { format!("{name}.{bias}") };
        let bias = tensors.get(bias.as_str()).copied();
        (weight.shape.len() == 2).then_some(Dense { name, weight, order, bias })
    };
    source.tensors.iter().filter_map(layer).collect()
}

/// The layers in the order in which they are applied: by their numbers where all have one, and else as they
/// stand in the file.
pub(super) fn in_order(mut layers: Vec<Dense<'_>>) -> Vec<Dense<'_>> {
    let stems: Option<HashSet<&str>> =
        layers.iter().map(|layer| numbered(layer.name).map(|(stem, _)| stem)).collect();
    if stems.is_some_and(|stems| stems.len() == 1) {
        layers.sort_by(|a, b| compare(a.name, b.name));
    }
    layers
}

/// The layers of the networks `asked`, one after the other.
///
/// # Errors
/// A sentence that lists the networks of the file if the choice is not clear, or names a tensor that no
/// dense layer has.
pub(super) fn named<'a>(
    source: &'a Source<'_>,
    layers: &[Dense<'a>],
    asked: &[String],
) -> Result<Vec<Dense<'a>>, String> {
    let each = asked.iter().map(|prefix| {
        let begins = layers.iter().any(|layer| starts_with(layer.name, prefix));
        let rule = if begins { starts_with } else { holds };
        let chosen = pick(source, layers, prefix, rule)?;
        let several = networks(&chosen);
        match several.len() {
            0 => {
                let listing = listing(&networks(layers));
                Err(format!("no dense layer under `{prefix}`; it has the networks:{listing}"))
            }
            1 => {
                let chosen = in_order(chosen);
                // A library's own names are in order; of others, nothing but numbers and widths says it.
                order::check(&chosen).map(|()| chosen)
            }
            _ => {
                let listing = listing(&several);
                Err(format!("`{prefix}` may be one of several networks; name one:{listing}"))
            }
        }
    });
    Ok(each.collect::<Result<Vec<_>, _>>()?.concat())
}

/// The layers of the only network.
///
/// # Errors
/// As [`named`].
pub(super) fn only<'a>(
    source: &'a Source<'_>,
    layers: &[Dense<'a>],
) -> Result<Vec<Dense<'a>>, String> {
    match networks(layers).as_slice() {
        [(name, _)] => pick(source, layers, name, starts_with).map(in_order),
        several => Err(format!(
            "{} networks; name the one that is meant with --network:{}",
            several.len(),
            listing(several)
        )),
    }
}

/// The refusal of a file without a dense layer.
pub(super) fn none(source: &Source<'_>) -> String {
    let names = || source.tensors.iter().map(|tensor| tensor.name.as_str());
    if let Some(name) = names().find(|name| is_parametrized(name)) {
        return parametrized(name);
    }
    if let Some(name) = names().find(|name| is_memory(split(name).1)) {
        return format!(
            "recurrent layers alone, `{name}` the first: a network with a memory is no dense one, and none is read"
        );
    }
    let count = source.tensors.len();
    let unmade = source.unmade.first().map(|object| {
        format!(
            "; `{}` is an object of `{}`, which a program would have to make: nothing was executed. Save tensors \
             alone: torch.save(module.state_dict(), FILE)",
            object.name, object.maker
        )
    });
    format!(
        "no dense layer among its {count} tensors: none is called `.weight` and has the shape [out, in]{}",
        unmade.unwrap_or_default()
    )
}

/// The layers that lie under `prefix`, which must be all that lies there.
fn pick<'a>(
    source: &'a Source<'_>,
    layers: &[Dense<'a>],
    prefix: &str,
    rule: fn(&str, &str) -> bool,
) -> Result<Vec<Dense<'a>>, String> {
    let chosen = layers.iter().filter(|layer| rule(layer.name, prefix));
    let chosen: Vec<Dense<'a>> = chosen.copied().collect();
    let parts = parts(&chosen);
    let (all, own) = (names(layers), names(&chosen));
    let known = Known { all: &all, own: &own };
    let bears = |tensor: &&Tensor| {
        let name = tensor.name.as_str();
        rule(name, prefix)
            && !parts.contains(name)
            && known.bearing(name, tensor.amount()) != Bearing::None
    };
    let others: Vec<&Tensor> = source.tensors.iter().filter(bears).collect();
    if let Some(tensor) = others.iter().find(|tensor| is_parametrized(&tensor.name)) {
        return Err(parametrized(&tensor.name));
    }
    let norm = others.iter().find_map(|tensor| norms::refusal(source, tensor));
    if let Some(norm) = norm.filter(|_| !chosen.is_empty()) {
        return Err(norm);
    }
    match others.first() {
        Some(Tensor { name, shape, .. }) if !chosen.is_empty() => Err(format!(
            "`{name}` of shape {shape:?} is no part of a dense layer, so this is not a plain \
             network; if it does not bear on the output, give --network the prefixes of its \
             layers, separated by commas"
        )),
        _ => Ok(chosen),
    }
}

/// The refusal of a weight that is computed from several tensors.
pub(super) fn parametrized(name: &str) -> String {
    format!(
        "`{name}` is a part of a weight that weight_norm or spectral_norm computes from several tensors; compute it before \
         saving: torch.nn.utils.parametrize.remove_parametrizations(layer, 'weight'), or remove_weight_norm(layer) and \
         remove_spectral_norm(layer) where the older functions were used"
    )
}

/// Refuses layers of an order that only the file's has, where another one is as likely.
///
/// # Errors
/// A sentence that names the layers in doubt, and the remedy.
pub(super) fn check_order(layers: &[Dense<'_>]) -> Result<(), String> {
    let without = |odd: &str| {
        let names = layers.iter().map(|layer| layer.name).filter(|name| *name != odd);
        names.collect::<Vec<_>>().join(",")
    };
    if layers.len() > 1
        && let Some(Dense { name, .. }) = layers.iter().find(|layer| gives_deviations(layer.name))
    {
        return Err(format!(
            "`{name}` may give deviations beside the layer before it, and not follow on it; without it: --network {}",
            without(name)
        ));
    }
    let table = |layer: &&Dense<'_>| split(layer.name).1.starts_with("emb") && layer.bias.is_none();
    if let Some(Dense { name, .. }) = layers.iter().find(table) {
        return Err(format!(
            "`{name}` has no bias, and is called as a table of embeddings is, which no dense layer stands for; if it is a \
             layer: --network {}",
            without("")
        ));
    }
    match layers.windows(2).find(|pair| may_stand_side_by_side(&pair[0], &pair[1])) {
        Some(pair) => Err(format!(
            "`{}` and `{}` may follow on one another, or both on the layer before: the names do not say it; if they follow: \
             --network {}",
            pair[0].name,
            pair[1].name,
            without("")
        )),
        None => Ok(()),
    }
}

/// Whether two layers may be heads of one body: square, and neither a last layer nor counted together.
fn may_stand_side_by_side(before: &Dense<'_>, after: &Dense<'_>) -> bool {
    let stem = |layer: &Dense<'_>| numbered(layer.name).map(|(stem, _)| stem.to_owned());
    let counted = stem(before).is_some() && stem(before) == stem(after);
    let ends = is_head(after.name) && !is_head(before.name);
    let square = [before.inputs(), before.outputs()] == [after.inputs(), after.outputs()];
    square && before.inputs() == before.outputs() && !counted && !ends
}

/// Names of layers.
pub(super) fn names<'a>(layers: &[Dense<'a>]) -> Vec<&'a str> {
    layers.iter().map(|layer| layer.name).collect()
}

/// Names of the tensors of these layers.
pub(super) fn parts<'a>(layers: &[Dense<'a>]) -> HashSet<&'a str> {
    let tensors = layers.iter().flat_map(|layer| [Some(layer.weight), layer.bias]);
    tensors.flatten().map(|tensor| tensor.name.as_str()).collect()
}

/// The networks that the layers form, in the order of the file.
pub(super) fn networks<'a>(layers: &[Dense<'a>]) -> Vec<(&'a str, Vec<Dense<'a>>)> {
    let mut numbers = HashMap::new();
    let mut found: Vec<(&str, Vec<Dense<'_>>)> = Vec::new();
    for layer in layers {
        let number = *numbers.entry(layer.network()).or_insert_with(|| {
            found.push((layer.network(), Vec::new()));
            found.len() - 1
        });
        found[number].1.push(*layer);
    }
    found.into_iter().map(|(name, layers)| (name, in_order(layers))).collect()
}

/// A line per network: its name and widths.
fn listing(networks: &[(&str, Vec<Dense<'_>>)]) -> String {
    let line = |(name, layers): &(&str, Vec<Dense<'_>>)| {
        let title = if name.is_empty() { "(no prefix)" } else { name };
        if layers.windows(2).all(|pair| pair[0].outputs() == pair[1].inputs()) {
            let outputs: String = layers.iter().map(|l| format!("-{}", l.outputs())).collect();
            let alone =
                if layers.len() == 1 { format!("  {}", layers[0].name) } else { String::new() };
            return format!("\n  {title}  {}{outputs}{alone}", layers[0].inputs());
        }
        let each =
            layers.iter().map(|l| format!("\n    {}  {}-{}", l.name, l.inputs(), l.outputs()));
        format!("\n  {title}  not one after the other:{}", each.collect::<String>())
    };
    let more = match networks.len().saturating_sub(MOST_LISTED) {
        0 => String::new(),
        more => format!("\n  and {more} more"),
    };
    networks.iter().take(MOST_LISTED).map(line).collect::<String>() + &more
}

/// Refuses layers that do not follow on one another, or have a bias that is not theirs; their numbers count unless
/// the order is `stated`.
///
/// # Errors
/// A sentence that names the two tensors that do not go together.
pub(super) fn check(layers: &[Dense<'_>], stated: bool) -> Result<(), String> {
    layers.iter().try_for_each(check_bias)?;
    let follows = |pair: &[Dense<'_>]| {
        check_widths(&pair[0], &pair[1])?;
        if stated { Ok(()) } else { check_numbers(&pair[0], &pair[1]) }
    };
    let pairs = layers.windows(2).try_for_each(follows);
    pairs.map_err(|problem| format!("{problem}{}", order::remedy(layers)))
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

/// Refuses a layer that takes another count of numbers than the one before gives.
fn check_widths(before: &Dense<'_>, after: &Dense<'_>) -> Result<(), String> {
    let (first, second) = (&before.weight.name, &after.weight.name);
    match before.outputs() == after.inputs() {
        true => Ok(()),
        false => Err(format!(
            "`{second}` takes {} numbers, `{first}` before it gives {}",
            after.inputs(),
            before.outputs()
        )),
    }
}

/// Refuses a layer whose number is not above that of the one before.
fn check_numbers(before: &Dense<'_>, after: &Dense<'_>) -> Result<(), String> {
    let (first, second) = (&before.weight.name, &after.weight.name);
    match (numbered(before.name), numbered(after.name)) {
        (Some((module, i)), Some((same, j))) if module == same && i >= j => Err(format!(
            "`{first}` stands before `{second}` in the file; the order of the layers is not clear"
        )),
        _ => Ok(()),
    }
}
