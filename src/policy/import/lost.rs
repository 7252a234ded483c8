//! What of a file is no part of the policy: refused where it may matter, named where it does not.

use std::collections::HashSet;

use super::bearing::{Bearing, Known, is_inert, is_parametrized};
use super::names::{split, starts_with};
use super::source::{Amount, Source, Tensor, Unmade};
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

/// The policy in a file.
#[derive(Debug)]
pub(super) struct Own<'a> {
    /// Names of its tensors.
    pub(super) used: &'a HashSet<String>,
    /// Modules of the statistics among them.
    pub(super) statistics: &'a HashSet<String>,
    /// Modules that are known to be no part of it.
    pub(super) beside: &'a [String],
    /// Its layers, in their order.
    pub(super) layers: &'a [&'a str],
    /// Flags that state what lies between its layers and behind them, each with a blank before it.
    pub(super) flags: &'a str,
}

/// Numbers or an object beside the policy.
#[derive(Clone, Copy)]
struct Rest<'a> {
    name: &'a str,
    amount: Amount,
    /// What would have made it.
    maker: Option<&'a str>,
}

/// What of a file is no tensor of the policy: tensors, plain numbers, and objects that nobody made.
fn rest<'a>(source: &'a Source<'_>, own: &Own<'_>) -> Vec<Rest<'a>> {
    let tensors = source.tensors.iter().filter(|tensor| !own.used.contains(&tensor.name));
    let tensors = tensors.filter(|tensor| !is_of_statistics(tensor, own.statistics));
    let tensors =
        tensors.map(|tensor| Rest { name: &tensor.name, amount: tensor.amount(), maker: None });
    let plain = source.plain.iter();
    let plain = plain.map(|plain| Rest { name: &plain.name, amount: plain.amount, maker: None });
    let unmade = source.unmade.iter().filter(|object| !is_inert(&object.maker));
    let unmade = unmade.map(|object| Rest {
        name: &object.name,
        amount: Amount::Many,
        maker: Some(&object.maker),
    });
    tensors.chain(plain).chain(unmade).collect()
}

/// Refuses what is not the policy's `own`, lies in nothing that is known to be beside it, and may act on what its
/// network is given or gives.
///
/// # Errors
/// The refusal, which names them, and says how the network is had without them.
pub(super) fn refuse(source: &Source<'_>, own: &Own<'_>) -> Result<(), String> {
    let all = layers::names(&layers::dense(source));
    let known = Known { all: &all, own: own.layers };
    let mut rest = rest(source, own);
    rest.retain(|rest| !own.beside.iter().any(|module| lies_beside(rest.name, module, &known)));
    let of = |wanted: Bearing| -> Vec<Rest<'_>> {
        let is = |rest: &&Rest<'_>| known.bearing(rest.name, rest.amount) == wanted;
        rest.iter().filter(is).copied().collect()
    };
    let (memory, unknown) = (of(Bearing::Memory), of(Bearing::Unknown));
    let remedy = remedy(source, &known, own.flags);
    let tensors = unknown.iter().filter_map(|rest| source.tensor(rest.name));
    let norm = tensors.filter_map(|tensor| norms::refusal(source, tensor)).next();
    let norm = norm.map_or(String::new(), |norm| format!(". {norm}"));
    if !memory.is_empty() {
        return Err(format!(
            "recurrent layers: {}; a network with a memory is no dense one. To import the dense layers alone, \
             which are another policy: {remedy}",
            listed(&memory)
        ));
    }
    if let Some(rest) = unknown.iter().find(|rest| is_parametrized(rest.name)) {
        return Err(layers::parametrized(rest.name));
    }
    match unknown.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "{} may act on what the network is given or gives, and would be lost; to import it without: {remedy}; an ONNX \
             export of the whole policy keeps it{norm}",
            listed(&unknown)
        )),
    }
}

/// Whether `name` lies in a module beside the policy; in an item of a tuple, if that has layers of its own.
fn lies_beside(name: &str, module: &str, known: &Known<'_>) -> bool {
    let is_item = split(module).1.parse::<u32>().is_ok();
    starts_with(name, module) && (!is_item || known.is_apart(module))
}

/// How the policy's layers are had alone: by their modules, where nothing else that matters lies in these.
fn remedy(source: &Source<'_>, known: &Known<'_>, flags: &str) -> String {
    let dense = layers::dense(source);
    let parts = layers::parts(&dense);
    let is_other = |tensor: &Tensor| {
        let bearing = known.bearing(&tensor.name, tensor.amount());
        !parts.contains(tensor.name.as_str()) && bearing != Bearing::None
    };
    let mut networks: Vec<&str> = Vec::new();
    for group in known.own.chunk_by(|a, b| dense::module(a) == dense::module(b)) {
        let module = dense::module(group[0]);
        let mut layers = known.all.iter().filter(|name| starts_with(name, module));
        let mut tensors = source.tensors.iter().filter(|tensor| starts_with(&tensor.name, module));
        let is_whole = layers.all(|layer| group.contains(layer));
        let is_pure = !tensors.any(is_other);
        match !module.is_empty() && is_whole && is_pure {
            true => networks.push(module),
            false => networks.extend(group),
        }
    }
    format!("--network {}{flags}", networks.join(","))
}

/// Whether a tensor lies in the module of statistics that are used: their squares and counts.
fn is_of_statistics(tensor: &Tensor, modules: &HashSet<String>) -> bool {
    let (module, key) = split(&tensor.name);
    let counts =
        ["_sumsq", "_var", "_count", "count", "summed_variance", "_mean", "_std", "std", "var"];
    counts.contains(&key.split('.').next().unwrap_or_default()) && modules.contains(module)
}

/// The first names, and how many more there are.
fn listed(rest: &[Rest<'_>]) -> String {
    let shown = |rest: &Rest<'_>| match rest.maker {
        Some(maker) => format!("`{}` (an object of `{maker}`, which was not made)", rest.name),
        None => format!("`{}`", rest.name),
    };
    let first: Vec<String> = rest.iter().take(LISTED).map(shown).collect();
    let more = match rest.len() - first.len() {
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
    let said = source.said.iter().map(|said| said.name.clone());
    let plain = source.plain.iter().map(|plain| plain.name.clone()).chain(said);
    unmade.chain(plain).chain(rest.into_iter().cloned()).collect()
}
