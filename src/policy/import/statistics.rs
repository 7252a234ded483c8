//! The statistics that libraries normalise observations with, as maps of a network's inputs.

use super::kind::Cast;
use super::map::Map;
use super::names::{around, starts_with};
use super::source::{Source, Tensor};

/// How a library calls the statistics, and what it does with them.
struct Statistics {
    /// What the names of its layouts begin with: another program may do something else with such statistics.
    library: &'static str,
    /// The means.
    mean: &'static str,
    /// What deviations are made of.
    spread: Spread,
    /// Limits of what comes of it.
    limit: Limit,
}

/// What deviations are made of.
#[derive(Clone, Copy)]
enum Spread {
    /// Deviations, and what is added to them.
    Deviation(&'static str, f64),
    /// Squares of them, and what is added to these.
    Variance(&'static str, f64),
}

/// Limits of observations that are normalised.
#[derive(Clone, Copy)]
enum Limit {
    None,
    /// The same for all.
    Number(f64),
    /// In the file.
    Tensor(&'static str),
}

/// The statistics of omnisafe, rsl_rl, safe-control-gym, rl_games and Brax.
const KNOWN: [Statistics; 8] = [
    Statistics {
        library: "omnisafe",
        mean: "obs_normalizer._mean",
        spread: Spread::Deviation("obs_normalizer._std", 0.0),
        limit: Limit::Tensor("obs_normalizer._clip"),
    },
    Statistics {
        library: "rsl_rl",
        mean: "actor_obs_normalizer._mean",
        spread: Spread::Deviation("actor_obs_normalizer._std", 1e-2),
        limit: Limit::None,
    },
    Statistics {
        library: "rsl_rl",
        mean: "obs_norm_state_dict._mean",
        spread: Spread::Deviation("obs_norm_state_dict._std", 1e-2),
        limit: Limit::None,
    },
    Statistics {
        library: "rsl_rl",
        mean: "actor_state_dict.obs_normalizer._mean",
        spread: Spread::Deviation("actor_state_dict.obs_normalizer._std", 1e-2),
        limit: Limit::None,
    },
    Statistics {
        library: "safe-control-gym",
        mean: "obs_normalizer.mean",
        spread: Spread::Variance("obs_normalizer.var", 1e-8),
        limit: Limit::Number(10.0),
    },
    Statistics {
        library: "rl_games",
        mean: "running_mean_std.running_mean",
        spread: Spread::Variance("running_mean_std.running_var", 1e-5),
        limit: Limit::Number(5.0),
    },
    Statistics {
        library: "Brax",
        mean: "0.mean.state",
        spread: Spread::Deviation("0.std.state", 0.0),
        limit: Limit::None,
    },
    Statistics {
        library: "Brax",
        mean: "0.mean",
        spread: Spread::Deviation("0.std", 0.0),
        limit: Limit::None,
    },
];

/// A map of observations, and the names that it is made of.
#[derive(Debug)]
pub(super) struct Normaliser {
    pub(super) map: Map,
    /// Names of its tensors.
    pub(super) names: Vec<String>,
    /// The module of its statistics.
    pub(super) module: String,
    /// What is added to its deviations or variances, and the limit of what comes of it, in words.
    pub(super) words: String,
}

/// The normaliser of a file of the layout `layout` whose network takes `inputs` numbers in the layer `first`, if the
/// file has one that is that library's, and the network's own.
///
/// # Errors
/// A sentence about statistics of another size, or from which no map follows.
pub(super) fn find(
    source: &mut Source<'_>,
    layout: &str,
    inputs: usize,
    first: &str,
) -> Result<Option<Normaliser>, String> {
    let mut own = KNOWN.iter().filter(|known| layout.starts_with(known.library));
    let found = own.find_map(|known| Some((known, tensors(source, known, first)?)));
    let Some((known, tensors)) = found else { return Ok(None) };
    let numbers: Result<Vec<Vec<f64>>, String> =
        tensors.iter().map(|tensor| source.numbers(tensor, Cast::ToF32)).collect();
    let mut numbers = numbers?;
    // Libraries take the means in f32, too.
    numbers[0].iter_mut().for_each(|mean| *mean = f64::from(*mean as f32));
    let module = around(&tensors[0].name, known.mean.rsplit('.').next().unwrap_or_default());
    let module = module.map_or("", |(module, _)| module).to_owned();
    if let Some(other) = numbers.iter().find(|numbers| numbers.len() != inputs) {
        return Err(format!(
            "`{module}` has statistics of {} observations, the network takes {inputs}; name the network with \
             --network to import it without them",
            other.len()
        ));
    }
    let map = map(known, &numbers).ok_or_else(|| {
        format!(
            "`{module}` has a deviation that is not positive; name the network with --network to \
                 import it without it"
        )
    })?;
    let names = tensors.into_iter().map(|tensor| tensor.name).collect();
    Ok(Some(Normaliser { map, names, module, words: known.in_words() }))
}

impl Statistics {
    /// What of it is not in the file, or is taken from it.
    fn in_words(&self) -> String {
        let less = match self.spread {
            Spread::Deviation(_, 0.0) => "(x - mean) / deviation".to_owned(),
            Spread::Deviation(_, more) => format!("(x - mean) / (deviation + {more})"),
            Spread::Variance(_, more) => format!("(x - mean) / sqrt(variance + {more})"),
        };
        match self.limit {
            Limit::None => less,
            Limit::Number(limit) => format!("{less}, within {limit}"),
            Limit::Tensor(name) => format!("{less}, within `{name}`"),
        }
    }
}

/// The tensors of these statistics: means, spreads, limits. Those of the network that `first` is a layer of lie in a
/// module around it.
fn tensors(source: &Source<'_>, known: &Statistics, first: &str) -> Option<Vec<Tensor>> {
    let ends = |name: &str| {
        source.tensors.iter().find(|tensor| {
            around(&tensor.name, name)
                .is_some_and(|(before, after)| after.is_empty() && starts_with(first, before))
        })
    };
    let (Spread::Deviation(spread, _) | Spread::Variance(spread, _)) = known.spread;
    let mut tensors = vec![ends(known.mean)?.clone(), ends(spread)?.clone()];
    if let Limit::Tensor(limit) = known.limit {
        tensors.push(ends(limit)?.clone());
    }
    Some(tensors)
}

/// What is done with observations.
fn map(known: &Statistics, numbers: &[Vec<f64>]) -> Option<Map> {
    let spread = numbers[1].iter();
    let deviations: Vec<f64> = match known.spread {
        Spread::Deviation(_, more) => spread.map(|deviation| deviation + more).collect(),
        Spread::Variance(_, more) => spread.map(|variance| (variance + more).sqrt()).collect(),
    };
    if !deviations.iter().all(|deviation| deviation.is_finite() && *deviation > 0.0) {
        return None;
    }
    let map = Map::normal(&numbers[0], &deviations);
    let limits = match known.limit {
        Limit::None => return Some(map),
        Limit::Number(limit) => vec![limit; deviations.len()],
        Limit::Tensor(_) => numbers[2].clone(),
    };
    Some(map.then(&Map::clamp(limits.iter().map(|limit| -limit).collect(), limits)))
}
