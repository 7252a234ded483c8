//! Which tensors of a file are the policy, in which order, and with what around them.

use std::collections::HashSet;

use super::applied::Layer;
use super::dense::{Dense, Order};
use super::draft::{Draft, MOST_LAYERS, Step};
use super::kind::Cast;
use super::layers;
use super::layouts::{self, Layout, Recognised};
use super::linear::Linear;
use super::lost;
use super::map::Map;
use super::names::{split, under};
use super::order;
use super::request::{Hints, Imported, Origin, Request};
use super::said::{self, Used};
use super::source::{Source, Tensor};
use super::statistics;
use crate::policy::Activation;

/// A layer that was chosen, apart from the file.
#[derive(Debug)]
struct Chosen {
    name: String,
    weight: Tensor,
    order: Order,
    bias: Option<Tensor>,
}

impl Chosen {
    fn of(layer: &Dense<'_>) -> Self {
        let Dense { name, weight, order, bias } = *layer;
        Self { name: name.to_owned(), weight: weight.clone(), order, bias: bias.cloned() }
    }
}

/// The layers of a policy, and the layout that they are of.
#[derive(Debug)]
struct Choice {
    layers: Vec<Chosen>,
    layout: Option<&'static Layout>,
    /// What stands before all names of the layout.
    outer: String,
    /// Numbers that the first layer takes.
    inputs: usize,
    /// Whether the layers were asked for by name, and nothing but them.
    by_name: bool,
}

/// A network with what it was made of.
#[derive(Default)]
struct Made {
    draft: Draft,
    /// Names of its tensors.
    used: HashSet<String>,
    /// Modules of the statistics among them.
    statistics: HashSet<String>,
    /// What is to be said about it.
    notes: Vec<String>,
}

/// The policy of a file of named tensors.
///
/// # Errors
/// A sentence about a choice that is not clear, parts that would be lost, or numbers that are damaged.
pub(super) fn policy(
    mut source: Source<'_>,
    request: &Request,
    hints: &Hints,
) -> Result<Imported, String> {
    let choice = Choice::of(&source, request)?;
    let dicts = choice.layers.iter().map(|layer| layer.weight.dict).collect();
    lost::refuse_unmade(&source, &dicts)?;
    let mut made = Made::default();
    let hints = &hints.with(choice.by_code(&source, request, &mut made)?);
    choice.add_statistics(&mut source, &mut made)?;
    choice.add_layers(&mut source, &mut made, request, hints)?;
    if !choice.by_name {
        let of_layout = choice.layout.and_then(|layout| layout.refusal).map(str::to_owned);
        hints.refusal.clone().or(of_layout).map_or(Ok(()), Err)?;
        choice.add_ends(&mut source, &mut made, hints)?;
        choice.refuse_lost(&source, &made, request, hints)?;
    } else {
        made.notes.extend(hints.around.iter().map(|around| format!("not in it: {around}")));
    }
    choice.say_beyond(&mut made, hints);
    let network = made.draft.network()?;
    // Last, since what is asked for is of no use to a file that is refused for another reason.
    choice.check_stated(request, hints)?;
    let [hidden, last] = choice.activations(request, hints);
    said::check(&source, hidden, last)?;
    let origin = |stated: bool, hinted: bool| match (stated, hinted, choice.layout) {
        (true, ..) => Origin::Stated,
        (_, true, _) => Origin::File,
        (_, _, Some(_)) => Origin::Layout,
        _ => Origin::Default,
    };
    Ok(Imported {
        network,
        left_out: lost::left_out(&source, &made.used),
        layers: choice.layers.into_iter().map(|layer| layer.name).collect(),
        layout: choice.layout.map(|layout| layout.name.to_owned()),
        notes: made.notes,
        activation_from: origin(request.activation.is_some(), hints.activation.is_some()),
        output_from: origin(request.output.is_some(), hints.output.is_some()),
    })
}

impl Choice {
    /// The layers that are asked for; those of the layout, or of the only network, if none is.
    fn of(source: &Source<'_>, request: &Request) -> Result<Self, String> {
        let dense = layers::dense(source);
        if dense.is_empty() {
            return Err(layers::none(source));
        }
        let recognised = layouts::recognise(source, &dense);
        let by_name = !request.networks.is_empty();
        let layers = match &recognised {
            _ if by_name => layers::named(source, &dense, &request.networks)?,
            Some(recognised) => recognised.layers.clone(),
            None => layers::only(source, &dense)?,
        };
        layers::check(&layers, request.networks.len() > 1)?;
        if !by_name && recognised.is_none() {
            layers::check_order(&layers)?;
            order::check(&layers)?;
        }
        if layers.len() > MOST_LAYERS {
            return Err(format!("{} layers; a network has at most {MOST_LAYERS}", layers.len()));
        }
        let same = |found: &&Recognised<'_>| layers::names(&found.layers) == layers::names(&layers);
        let found = recognised.as_ref().filter(same);
        Ok(Self {
            layout: found.map(|found| found.layout),
            outer: found.map_or(String::new(), |found| found.outer.clone()),
            inputs: layers[0].inputs(),
            layers: layers.iter().map(Chosen::of).collect(),
            by_name,
        })
    }

    /// What the code of a compiled module applies behind each layer, if there is code, and it does no more.
    fn by_code(
        &self,
        source: &Source<'_>,
        request: &Request,
        made: &mut Made,
    ) -> Result<Option<Vec<Activation>>, String> {
        let Some(script) = &source.script else { return Ok(None) };
        let layer =
            |layer: &Chosen| Layer { name: layer.name.clone(), has_bias: layer.bias.is_some() };
        let layers: Vec<Layer> = self.layers.iter().map(layer).collect();
        let behind = script.settled(&layers, request)?;
        made.notes.push(behind.note);
        Ok(behind.activations)
    }

    /// Refuses layers of which nobody says what lies between them: neither the file, nor a layout, nor the request.
    fn check_stated(&self, request: &Request, hints: &Hints) -> Result<(), String> {
        // Of an archive that says what it was given, the rest is known to whoever names a part of it.
        if self.layout.is_some() || (self.by_name && !hints.is_said) {
            return match &hints.unsaid {
                Some(unsaid) if request.activation.is_none() => Err(unsaid.clone()),
                _ => Ok(()),
            };
        }
        if !self.by_name {
            self.refuse_doubled()?;
        }
        let hidden = self.layers.len() > 1 && request.activation.or(hints.activation).is_none();
        let single = self.layers.len() == 1 && request.output.or(hints.output).is_none();
        let (flag, what) = match (hidden, single) {
            (true, _) => ("--activation", "lies between the layers"),
            (_, true) => ("--output", "follows its one layer"),
            _ => return Ok(()),
        };
        Err(format!(
            "the file does not say what {what}, and its names are those of no library that is known; state it: {flag} with \
             one of {}{}",
            Activation::words(),
            if hidden {
                ", and --output what follows the last layer (`tanh` if it is not stated)"
            } else {
                ""
            }
        ))
    }

    /// Refuses an actor of pytorch_sac that stands alone, whose last layer gives deviations, too.
    fn refuse_doubled(&self) -> Result<(), String> {
        let Some(last) = self.layers.last() else { return Ok(()) };
        let module = split(&last.name).0;
        let width = last.weight.shape[usize::from(last.order == Order::InOut)];
        match split(module).1 == "trunk" && width.is_multiple_of(2) {
            true => Err(format!(
                "`{module}` is what pytorch_sac calls its actor, whose last layer gives means and as many deviations: of \
                 {width} outputs, the first {} would be the policy, and the file does not say it. Save the agent with its \
                 critic (`actor.` and `critic.` before the names), or export the means to ONNX; --network {module} \
                 imports all outputs",
                width / 2
            )),
            false => Ok(()),
        }
    }

    /// Adds the map that normalises what the network is given, where the file has its statistics.
    fn add_statistics(&self, source: &mut Source<'_>, made: &mut Made) -> Result<(), String> {
        let Some(layout) = self.layout.filter(|_| !self.by_name) else { return Ok(()) };
        if let Some(normaliser) =
            statistics::find(source, layout.name, self.inputs, &self.layers[0].name)?
        {
            made.draft.push(Step::Map(normaliser.map))?;
            made.notes.push(format!(
                "the inputs are normalised by `{}` first, as {} does: {}",
                normaliser.module, layout.name, normaliser.words
            ));
            made.statistics.extend(normaliser.names.iter().map(|name| split(name).0.to_owned()));
            made.used.extend(normaliser.names);
        }
        Ok(())
    }

    /// What lies between the layers, and behind the last one.
    fn activations(&self, request: &Request, hints: &Hints) -> [Used; 2] {
        let [hidden, last] = match self.layout {
            Some(layout) => [layout.hidden, layout.last],
            None => [Activation::Relu, self.usual_output()],
        };
        [(request.activation, hints.activation, hidden), (request.output, hints.output, last)].map(
            |(stated, hinted, usual)| Used {
                activation: stated.or(hinted).unwrap_or(usual),
                is_stated: stated.is_some(),
            },
        )
    }

    /// Refuses what would be lost.
    fn refuse_lost(
        &self,
        source: &Source<'_>,
        made: &Made,
        request: &Request,
        hints: &Hints,
    ) -> Result<(), String> {
        let layers: Vec<&str> = self.layers.iter().map(|layer| layer.name.as_str()).collect();
        let beside = self.layout.map_or(Vec::new(), |layout| layout.beside(&self.outer));
        let known = |used: &Used| used.is_stated || self.layout.is_some();
        let used = self.activations(request, hints).into_iter().zip(["activation", "output"]);
        let flags = used.filter(|(used, _)| known(used));
        let flags = flags.map(|(used, flag)| format!(" --{flag} '{}'", used.activation.name()));
        let flags = &flags.collect::<String>();
        let (used, statistics) = (&made.used, &made.statistics);
        let own = lost::Own { used, statistics, beside: &beside, layers: &layers, flags };
        lost::refuse(source, &own)
    }

    /// Adds the layers and what follows each of them.
    fn add_layers(
        &self,
        source: &mut Source<'_>,
        made: &mut Made,
        request: &Request,
        hints: &Hints,
    ) -> Result<(), String> {
        let [hidden, behind] = self.activations(request, hints).map(|used| used.activation);
        for (i, layer) in self.layers.iter().enumerate() {
            let is_last = i + 1 == self.layers.len();
            let mut linear = linear(source, layer, request.cast)?;
            if is_last && self.layout.is_some_and(|layout| layout.doubled) {
                made.notes.push(match self.by_name {
                    false => halve(&mut linear, &layer.name)?,
                    true => format!(
                        "`{}` gives means and as many deviations, and all of them are outputs here",
                        layer.name
                    ),
                });
            }
            made.draft.push(Step::Linear(linear))?;
            self.add_clip(layer, made, hints)?;
            let stated = if is_last { request.output } else { request.activation };
            let said = stated.or(hints.behind.as_ref().and_then(|behind| behind.get(i)).copied());
            let usual = if is_last { behind } else { hidden };
            made.draft.push(Step::Activation(said.unwrap_or(usual)))?;
            let bias = layer.bias.iter().map(|bias| bias.name.clone());
            made.used.extend(bias.chain([layer.weight.name.clone()]));
        }
        Ok(())
    }

    /// Adds the limits that the layout has behind a layer.
    fn add_clip(&self, layer: &Chosen, made: &mut Made, hints: &Hints) -> Result<(), String> {
        let clipped = self.layout.and_then(|layout| layout.clipped);
        let Some((_, usual)) = clipped.filter(|(name, _)| under(&self.outer, name) == layer.name)
        else {
            return Ok(());
        };
        let limit = hints.clip.unwrap_or(usual);
        // The library has no clip then.
        if limit <= 0.0 {
            return Ok(());
        }
        let what = format!("the sums of `{}` stay within {limit} (clip_mean)", layer.name);
        if self.by_name {
            made.notes.push(format!("not in it: {what}"));
            return Ok(());
        }
        let source =
            if hints.clip.is_some() { "`data` says" } else { "the library does by default" };
        made.notes.push(format!("{what}, as {source}"));
        let clip = Activation::Hardtanh { low: -limit as f32, high: limit as f32 };
        made.draft.push(Step::Activation(clip))
    }

    /// What is behind the last layer where nobody says it.
    fn usual_output(&self) -> Activation {
        let critic = |key: &str| key.starts_with("critic");
        match self.layers.iter().any(|layer| layer.name.split('.').any(critic)) {
            true => Activation::Identity,
            false => Activation::Tanh,
        }
    }

    /// Adds what the output goes through.
    fn add_ends(
        &self,
        source: &mut Source<'_>,
        made: &mut Made,
        hints: &Hints,
    ) -> Result<(), String> {
        let width = made.draft.width().unwrap_or_default();
        if let Some(names) = self.layout.and_then(|layout| layout.scaled) {
            let names = names.map(|name| under(&self.outer, name));
            let [scale, shift] =
                [numbers(source, &names[0], width)?, numbers(source, &names[1], width)?];
            made.draft.push(Step::Map(Map::affine(scale, shift)))?;
            made.notes.push(format!(
                "the output is multiplied by `{}`, and `{}` is added",
                names[0], names[1]
            ));
            made.used.extend(names);
        }
        if let Some(map) = &hints.output_map {
            made.draft.push(Step::Map(map.widened(width)))?;
            made.notes.extend(hints.around.iter().cloned());
        }
        Ok(())
    }

    /// Says what of inputs and outputs the file does not hold.
    fn say_beyond(&self, made: &mut Made, hints: &Hints) {
        made.notes.extend(hints.notes.iter().cloned());
        let beyond = self.layout.and_then(|layout| layout.beyond);
        let unsaid = self.layout.and_then(|layout| layout.unsaid).filter(|_| !hints.is_said);
        made.notes.extend(beyond.or(unsaid).map(|beyond| format!("not in it: {beyond}")));
    }
}

/// The layer with its numbers.
fn linear(source: &mut Source<'_>, layer: &Chosen, cast: Cast) -> Result<Linear, String> {
    let numbers = source.numbers(&layer.weight, cast)?;
    let [rows, columns] = [layer.weight.shape[0], layer.weight.shape[1]];
    let linear = match layer.order {
        Order::OutIn => Linear::new(numbers, columns),
        Order::InOut => Linear::transposed(&numbers, [rows, columns]),
    };
    match &layer.bias {
        Some(bias) => Ok(Linear { bias: source.numbers(bias, cast)?, ..linear }),
        None => Ok(linear),
    }
}

/// Leaves the means of a layer that gives means and deviations; what is to be said about it.
fn halve(linear: &mut Linear, name: &str) -> Result<String, String> {
    let (half, rest) = (linear.outputs() / 2, linear.outputs() % 2);
    if rest != 0 {
        let width = linear.outputs();
        return Err(format!(
            "`{name}` gives {width} numbers, which are no means and as many deviations"
        ));
    }
    *linear = linear.selected(&(0..half).collect::<Vec<_>>());
    Ok(format!(
        "`{name}` gives {half} means and {half} deviations of a Gaussian; the means are taken"
    ))
}

/// The `width` numbers of the tensor `name`, or its one number as many times.
fn numbers(source: &mut Source<'_>, name: &str, width: usize) -> Result<Vec<f64>, String> {
    let tensor = source.tensor(name).cloned().ok_or_else(|| format!("no tensor `{name}`"))?;
    let numbers = source.numbers(&tensor, Cast::ToF32)?;
    match numbers.len() {
        1 => Ok(vec![numbers[0]; width]),
        have if have == width => Ok(numbers),
        have => Err(format!("`{name}` has {have} numbers, the network gives {width}")),
    }
}
