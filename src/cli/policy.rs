//! The commands `policy import` and `policy inspect`: policy files made and looked at.

use std::path::Path;

use serde::Serialize;

use super::args::ImportArguments;
use super::options::{Global, Keys};
use super::{Outcome, document, folder_of, report};
use crate::config::{Config, PolicySource};
use crate::error::{Error, Result};
use crate::files::{Inputs, Staged};
use crate::policy::Mlp;
use crate::policy::import::{self, Cast, Origin, Request};
use crate::policy::inspect::{Inspection, output_intervals, output_ranges};
use crate::real::bound::Interval;
use crate::rollout::{Purpose, Stream};
use crate::rounding::{finite_interval, finite_lower, finite_upper};
use crate::system::Axis;

/// Ending of policy files.
const ENDING: &str = "safetensors";
/// Tensors, or groups of them, that a line lists.
const LISTED: usize = 12;
/// What is said of a bound that is rough.
const ROUGH: &str = " (rough, by sums of its weights: too wide a layer for a better bound)";
/// Random states that the range of actions is seen over.
const SAMPLES: u64 = 16_384;
/// Most multiplications of all random states together: seconds of work.
const MOST_PRODUCTS: u64 = 1 << 34;
/// States that are evaluated side by side.
const LANES: usize = 16;

/// Which states and controls a configuration has, and the box of the states.
struct Frame {
    states: Vec<String>,
    controls: Vec<String>,
    low: Vec<f32>,
    high: Vec<f32>,
}

/// The frame of the configuration at `path`, which the network of `file` has to fit.
fn frame(global: &Global, path: &Path, file: &Path, network: &Mlp) -> Result<(Config, Frame)> {
    let config = Config::load(path, &global.overrides())?;
    let (path, network) = (file.to_owned(), network.clone());
    let source = PolicySource::Network { path, bytes: Vec::new(), network };
    let model = config.plant(&source)?.model;
    let settings = config.settings(&model.states)?;
    let names = |axes: &[Axis]| axes.iter().map(|axis| axis.name.clone()).collect();
    let (states, controls) = (names(&model.states), names(&model.controls));
    Ok((config, Frame { states, controls, low: settings.low, high: settings.high }))
}

/// What `policy import --json` prints.
#[derive(Serialize)]
struct Import {
    file: String,
    out: String,
    /// Names of the layers in the file.
    layers: Vec<String>,
    /// Names of the tensors in the file that are no part of it.
    left_out: Vec<String>,
    /// The library or format whose layout the file has.
    layout: Option<String>,
    /// Whether something of the file may act on what the policy is given or gives.
    #[serde(skip)]
    may_bear: bool,
    /// What else was made of the file, and what its library does that is not in it.
    notes: Vec<String>,
    widths: Vec<usize>,
    activation: String,
    activation_from: Origin,
    output: String,
    output_from: Origin,
    state_order: Option<Vec<String>>,
    parameter_count: usize,
    digest: String,
}

/// Writes a network of a checkpoint or a graph as a policy file.
pub(super) fn import(global: &Global, asked: &ImportArguments) -> Result<Outcome> {
    let (out, name) = destination(global)?;
    keys_need_config(global, asked.config.as_deref())?;
    let read = std::iter::once(asked.file.clone()).chain(asked.config.clone());
    Inputs::new(read).spare_file(out)?;
    let request = Request {
        networks: asked.network.clone(),
        activation: asked.activation,
        output: asked.output,
        cast: if asked.cast { Cast::ToF32 } else { Cast::Refused },
    };
    let found = import::read(&asked.file, &request).map_err(as_flag)?;
    let network = with_names(global, asked, found.network)?;
    let mut staged = Staged::new(folder_of(out))?;
    staged.add(name, &network.to_bytes())?;
    staged.publish_sparing(global.existing)?;
    let import = Import {
        file: asked.file.display().to_string(),
        out: out.display().to_string(),
        layers: found.layers,
        left_out: found.left_out,
        // Nothing around layers that are named is looked at; else what may act is refused.
        may_bear: !asked.network.is_empty(),
        layout: found.layout,
        notes: found.notes,
        widths: network.widths(),
        activation: network.hidden_words(),
        activation_from: found.activation_from,
        output: network.output().name(),
        output_from: found.output_from,
        state_order: network.state_order().map(<[String]>::to_vec),
        parameter_count: network.parameter_count(),
        digest: network.digest(),
    };
    report(global, &document(&import), || import_text(&import))?;
    Ok(Outcome::Done)
}

/// Refuses what lies over a configuration where there is none.
fn keys_need_config(global: &Global, config: Option<&Path>) -> Result<()> {
    let Keys { profile, set } = &global.changes.keys;
    let problem = "changes nothing without a configuration; give --config, or leave it out";
    match (config, profile, set.first()) {
        (None, Some(_), _) => Err(Error::invalid("--profile", problem)),
        (None, None, Some(set)) => Err(Error::invalid(format!("--set {set}"), problem)),
        _ => Ok(()),
    }
}

/// The policy file that is to be written, and its name in its folder.
fn destination(global: &Global) -> Result<(&Path, &str)> {
    let missing = || Error::invalid("--out", "missing; name the policy file, OUT.safetensors");
    let out = global.out.as_deref().ok_or_else(missing)?;
    let name = out.file_name().and_then(|name| name.to_str());
    let name = name.filter(|_| out.extension().is_some_and(|ending| ending == ENDING));
    let other = || {
        let problem = format!("{}: the name has to end in .{ENDING}", out.display());
        Error::invalid("--out", problem)
    };
    Ok((out, name.ok_or_else(other)?))
}

/// The network with the names of its inputs, where they are given.
fn with_names(global: &Global, asked: &ImportArguments, network: Mlp) -> Result<Mlp> {
    let names = match (&asked.state_order, &asked.config) {
        (Some(names), _) => names.clone(),
        (None, Some(config)) => frame(global, config, &asked.file, &network)?.1.states,
        (None, None) => return Ok(network),
    };
    network.with_state_order(names).map_err(as_flag)
}

/// The error with the flag for its place.
fn as_flag(error: Error) -> Error {
    match error {
        Error::Invalid { place, problem } => {
            Error::invalid(format!("--{}", place.replace(' ', "-")), problem)
        }
        other => other,
    }
}

/// What was imported, and what the file did not say.
fn import_text(import: &Import) -> String {
    let layout = import.layout.as_deref();
    let from = |origin: Origin, flag: &str| match (origin, layout) {
        (Origin::File, _) => "as the file has it".to_owned(),
        (Origin::Stated, _) => "as stated".to_owned(),
        (Origin::Layout, Some(layout)) => {
            format!("as {layout} has it by default; --{flag} states another")
        }
        _ => format!("the default: the file does not say, --{flag} does"),
    };
    let inputs = import.state_order.as_ref().map(|names| names.join(","));
    format!(
        "{}: network {}, {} parameters\n\
         {}layers      {}\n\
         activation  {} ({})\n\
         output      {} ({})\n\
         inputs      {}\n\
         digest      {}\n{}{}",
        import.out,
        widths(&import.widths),
        import.parameter_count,
        layout.map_or(String::new(), |layout| format!("layout      {layout}\n")),
        import.layers.join(", "),
        import.activation,
        from(import.activation_from, "activation"),
        import.output,
        from(import.output_from, "output"),
        inputs.as_deref().unwrap_or("not named; --config or --state-order names them"),
        import.digest,
        import.notes.iter().map(|note| format!("note        {note}\n")).collect::<String>(),
        left_out(&import.left_out, import.may_bear),
    )
}

/// What of the file is no part of the network; nothing if all is.
fn left_out(names: &[String], may_bear: bool) -> String {
    if names.is_empty() {
        return String::new();
    }
    let listed = format!("left out    {}\n", grouped(names).join(", "));
    if !may_bear {
        return listed;
    }
    listed
        + "note: these tensors of the file are no part of the policy; if some of them act on its inputs or outputs \
           (statistics that normalise observations do), it is another policy without them\n"
}

/// All names, those that begin alike together where there are many.
fn grouped(names: &[String]) -> Vec<String> {
    if names.len() <= LISTED {
        return names.to_vec();
    }
    let deepest = names.iter().map(|name| name.split('.').count()).max().unwrap_or(1);
    let at = |depth: usize| groups(names, depth);
    (1..=deepest)
        .map(at)
        .take_while(|groups| groups.len() <= LISTED)
        .last()
        .unwrap_or_else(|| at(1))
}

/// The names that share their first `depth` keys, as these and their number.
fn groups(names: &[String], depth: usize) -> Vec<String> {
    let mut groups: Vec<(String, usize)> = Vec::new();
    for name in names {
        let group = name.split('.').take(depth).collect::<Vec<_>>().join(".");
        match groups.iter_mut().find(|(known, _)| *known == group) {
            Some((_, count)) => *count += 1,
            None => groups.push((group, 1)),
        }
    }
    let words = |(group, count): (String, usize)| match count {
        1 => group,
        _ => format!("{group} ({count} tensors)"),
    };
    groups.into_iter().map(words).collect()
}

/// Widths as in `12-64-3`.
fn widths(widths: &[usize]) -> String {
    widths.iter().map(usize::to_string).collect::<Vec<_>>().join("-")
}

/// What `policy inspect --json` prints.
#[derive(Serialize)]
struct Inspect {
    file: String,
    #[serde(flatten)]
    network: Inspection,
    /// Corners of the box that the actions are over.
    #[serde(with = "crate::files::number")]
    low: Vec<f32>,
    #[serde(with = "crate::files::number")]
    high: Vec<f32>,
    actions: Vec<Action>,
    /// Random states that `seen` is over.
    samples: u64,
    seed: u64,
}

/// The range of an action over the box.
#[derive(Serialize)]
struct Action {
    name: String,
    /// By interval arithmetic: every state of the box.
    #[serde(with = "crate::files::number")]
    interval: [f64; 2],
    /// Of the random states.
    #[serde(with = "crate::files::number")]
    seen: [f32; 2],
}

/// Prints what a policy file holds.
pub(super) fn inspect(global: &Global, file: &Path, config: Option<&Path>) -> Result<Outcome> {
    keys_need_config(global, config)?;
    let network = Mlp::load(file)?;
    let seed = global.changes.seed.unwrap_or(1);
    let (seed, frame) = match config {
        Some(path) => {
            let (config, frame) = frame(global, path, file, &network)?;
            (config.seed, frame)
        }
        None => (seed, unit_frame(&network)),
    };
    let samples = samples(&network);
    let inspect = Inspect {
        file: file.display().to_string(),
        actions: actions(&network, &frame, seed, samples)?,
        network: Inspection::of(&network),
        low: frame.low,
        high: frame.high,
        samples,
        seed,
    };
    let place = config.map_or("from -1 to 1".to_owned(), |path| path.display().to_string());
    report(global, &document(&inspect), || inspect_text(&inspect, &place))?;
    Ok(Outcome::Done)
}

/// The box from -1 to 1, with numbers for names.
fn unit_frame(network: &Mlp) -> Frame {
    let widths = network.widths();
    let numbered = |count: usize| (0..count).map(|i| i.to_string()).collect();
    let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
    Frame {
        states: numbered(inputs),
        controls: numbered(outputs),
        low: vec![-1.0; inputs],
        high: vec![1.0; inputs],
    }
}

/// How many random states are evaluated: fewer of a large network, in whole batches.
fn samples(network: &Mlp) -> u64 {
    let most = MOST_PRODUCTS / network.parameter_count() as u64;
    (most.min(SAMPLES) / LANES as u64).max(1) * LANES as u64
}

/// The range of each action over the box.
fn actions(network: &Mlp, frame: &Frame, seed: u64, samples: u64) -> Result<Vec<Action>> {
    let Frame { controls, low, high, .. } = frame;
    let sides = low.iter().zip(high).map(|(&low, &high)| Interval::new(low.into(), high.into()));
    let intervals = output_intervals(network, &sides.collect::<Vec<_>>())?;
    let stream = Stream::new(seed, Purpose::USER, 0);
    let batches = (0..samples).step_by(LANES).map(|i| stream.in_box::<LANES>(low, high, i));
    let seen = output_ranges(network, batches);
    let action = |((name, Interval { low, high }), seen): ((&String, _), _)| Action {
        name: name.clone(),
        interval: [low, high],
        seen,
    };
    Ok(controls.iter().zip(intervals).zip(seen).map(action).collect())
}

/// The inspection in words; `place` names the box.
fn inspect_text(inspect: &Inspect, place: &str) -> String {
    let Inspect { network, .. } = inspect;
    let names = network.state_order.as_ref().map(|names| names.join(","));
    let mut text = format!(
        "{}: network {}, {} parameters\n\
         activation  {}, output {}\n\
         inputs      {}\n\
         digest      {}\n",
        inspect.file,
        widths(&network.widths),
        network.parameter_count,
        network.activation,
        network.output,
        names.as_deref().unwrap_or("not named"),
        network.digest,
    );
    for (i, layer) in network.layers.iter().enumerate() {
        text += &format!(
            "layer {i}     {} -> {}, weights {}, biases {}, spectral norm at most {}{}\n",
            layer.inputs,
            layer.outputs,
            finite_interval(layer.weight_range.map(f64::from)),
            finite_interval(layer.bias_range.map(f64::from)),
            finite_upper(layer.spectral_norm),
            if layer.spectral_norm_is_rough { ROUGH } else { "" }
        );
    }
    text += &format!("Lipschitz   at most {}, everywhere\n", finite_upper(network.lipschitz_bound));
    text += &format!("actions     over the box ({place}):\n");
    for Action { name, interval: within, seen: [least, largest] } in &inspect.actions {
        // What was seen is rounded inwards: it was; all of it, where it lies between two such numbers.
        let ends = [least, largest].map(|end| f64::from(*end));
        let inwards = [finite_upper(ends[0]), finite_lower(ends[1])];
        let seen = match inwards.each_ref().map(|end| end.parse::<f64>()) {
            [Ok(low), Ok(high)] if low > high => format!("seen within {}", finite_interval(ends)),
            _ => format!("seen {} to {}", inwards[0], inwards[1]),
        };
        let within = finite_interval(*within);
        text += &format!("  {name}  within {within}; {seen} in {} states\n", inspect.samples);
    }
    text
}
