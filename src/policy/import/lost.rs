//! What of a file is no part of the policy: refused where it may matter, named where it does not.

use std::collections::HashSet;

use super::bearing::{Bearing, Known, is_parametrized};
use super::names::{split, starts_with};
use super::source::{Source, Tensor, Unmade};
use super::{dense, layers, norms};

/// Names that a refusal lists.
const LISTED: usize = 6;

/// Refuses objects that were not made in the dictionaries of the policy's own tensors.
///
/// # Errors
/// The refusal, which names the first of them.
pub(super) fn refuse_unmade(source: &Source<'_>, dicts: &HashSet<usize>) -> Result<(), String> {
    match source.unmade.iter().find(|object| dicts.contains(&object.dict)) {
        Some(Unmade { name, maker, .. }) => Err(format!(
            "`{name}`, beside the policy's tensors, is an object of `{maker}`, which a program would have to make; \
             nothing was executed. Save tensors alone: torch.save(module.state_dict(), FILE)"
        )),
        None => Ok(()),
    }
}

/// Refuses tensors and plain numbers that are not `used`, lie under nothing that is `beside` the policy, and may
/// act on what the network of the layers `own` is given or gives.
///
/// # Errors
/// The refusal, which names them, and says how the network is had without them.
pub(super) fn refuse(
    source: &Source<'_>,
    used: &HashSet<String>,
    beside: &[String],
    own: &[&str],
) -> Result<(), String> {
    let modules: HashSet<&str> = used.iter().map(|name| split(name).0).collect();
    let rest = source.tensors.iter().filter(|tensor| !used.contains(&tensor.name));
    let rest = rest.filter(|tensor| !is_of_statistics(tensor, &modules));
    let rest = rest.map(|tensor| tensor.name.as_str());
    let lies_beside = |name: &&str| beside.iter().any(|module| starts_with(name, module));
    let rest = rest.chain(source.plain.iter().map(String::as_str));
    let rest: Vec<&str> = rest.filter(|name| !lies_beside(name)).collect();
    let all = layers::names(&layers::dense(source));
    let known = Known { all: &all, own };
    let of = |wanted: Bearing| -> Vec<&str> {
        rest.iter().copied().filter(|name| known.bearing(name) == wanted).collect()
    };
    let remedy = remedy(own);
    let (memory, unknown) = (of(Bearing::Memory), of(Bearing::Unknown));
    let tensors = unknown.iter().filter_map(|name| source.tensor(name));
    let norm = tensors.filter_map(|tensor| norms::refusal(source, tensor)).next();
    let norm = norm.map_or(String::new(), |norm| format!(". {norm}"));
    match (memory.is_empty(), unknown.is_empty()) {
        (false, _) => Err(format!(
            "recurrent layers: {}; a network with a memory is no dense one. To import the dense layers alone, \
             which are another policy: {remedy}",
            listed(&memory)
        )),
        (_, false) if unknown.iter().any(|name| is_parametrized(name)) => {
            let name = unknown.iter().find(|name| is_parametrized(name));
            Err(layers::parametrized(name.copied().unwrap_or_default()))
        }
        (_, false) => Err(format!(
            "{} may act on what the network is given or gives, and would be lost; to import it without: {remedy}; an ONNX \
             export of the whole policy keeps it{norm}",
            listed(&unknown)
        )),
        _ => Ok(()),
    }
}

/// How the layers `own` are had alone.
fn remedy(own: &[&str]) -> String {
    let module = dense::module(own.first().copied().unwrap_or_default());
    match module {
        "" => format!("--network {}", own.join(",")),
        module => format!("--network {module}"),
    }
}

/// Whether a tensor lies in the module of statistics that are used: their squares and counts.
fn is_of_statistics(tensor: &Tensor, modules: &HashSet<&str>) -> bool {
    let (module, key) = split(&tensor.name);
    let counts =
        ["_sumsq", "_var", "_count", "count", "summed_variance", "_mean", "_std", "std", "var"];
    counts.contains(&key.split('.').next().unwrap_or_default()) && modules.contains(module)
}

/// The first names, and how many more there are.
fn listed(names: &[&str]) -> String {
    let first: Vec<String> = names.iter().take(LISTED).map(|name| format!("`{name}`")).collect();
    let more = match names.len() - first.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", first.join(", "))
}

/// Names of what is not `used`: objects that were not made, plain numbers and words, tensors of no dense layer, and the
/// others.
pub(super) fn left_out(source: &Source<'_>, used: &HashSet<String>) -> Vec<String> {
    let dense = layers::dense(source);
    let of_layers = layers::parts(&dense);
    let unmade = source.unmade.iter().map(|object| format!("{} ({})", object.name, object.maker));
    let rest =
        source.tensors.iter().map(|tensor| &tensor.name).filter(|name| !used.contains(*name));
    let mut rest: Vec<&String> = rest.collect();
    rest.sort_by_key(|name| of_layers.contains(name.as_str()));
    let plain = source.plain.iter().chain(&source.said).cloned();
    unmade.chain(plain).chain(rest.into_iter().cloned()).collect()
}
