//! The text of plants whose formulas call networks: a kernel for each part between two networks.

use std::ops::Range;
use std::sync::Arc;

use super::glue::load_glue;
use super::kernels::{Access, Kernel, Slot};
use super::physics_glue::{Outline, parameter_glue, seconds_glue};
use crate::error::{Error, Result};
use crate::formula::wgsl::careful_function;
use crate::formula::{Ask, Chain, Expr, Graph, Link, Place, Scalar, record};
use crate::model::{Controller, Law, Model};
use crate::policy::Mlp;

const LINK: &str = include_str!("../../../../shaders/link.wgsl");

/// Most links of a plant: each is a kernel to compile, and a dispatch of every step.
const MOST_LINKS: usize = 128;

/// Kept numbers before the controls: target and constraint margin.
const MARGINS: usize = 2;

/// The formulas of a plant cut at the networks that they call, one step of a rollout: margins and
/// controls first, the policy's own network among them, then the next state.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainText {
    links: Vec<LinkText>,
    /// How many of the links come before the controls are known.
    deciding: usize,
    sizes: ChainSizes,
    networks: Vec<Arc<Mlp>>,
}

/// Numbers of a trajectory that links and networks hand on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct ChainSizes {
    /// Margins, controls, the next state, and what later links need.
    pub(in super::super) kept: usize,
    /// Inputs of networks, each from a whole vector on.
    pub(in super::super) asked: usize,
    /// Outputs of networks.
    pub(in super::super) said: usize,
}

/// A kernel between two networks.
#[derive(Clone, Debug, PartialEq)]
struct LinkText {
    /// What it evaluates.
    text: String,
    /// Whether it is told what networks before it said.
    told: bool,
    /// The networks that run behind it.
    asks: Vec<AskShape>,
}

/// A network that runs behind a link.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct AskShape {
    /// Its number among the networks of the chain.
    pub(in super::super) network: usize,
    /// The numbers that are its inputs.
    pub(in super::super) asked: Range<usize>,
    /// The numbers that are its outputs.
    pub(in super::super) said: Range<usize>,
}

impl ChainText {
    /// The chain of a plant whose formulas call networks; `None` for any other.
    ///
    /// # Errors
    /// [`Error::Device`] if too many networks follow one another.
    pub(super) fn new(
        outline: &Outline,
        model: &Model,
        controller: &Controller,
    ) -> Result<Option<Self>> {
        if !calls_networks(model, controller) {
            return Ok(None);
        }
        let chains = [Chain::new(&decision(model, controller)), Chain::new(&model.step)];
        let count: usize = chains.iter().map(|chain| chain.links.len()).sum();
        if count > MOST_LINKS {
            return Err(Error::Device(format!(
                "the formulas of a step are {count} parts with networks between them; at most {MOST_LINKS} run \
                 on an adapter: give `--backend cpu`, or fewer `substeps`"
            )));
        }
        let size = |of: fn(&Chain) -> usize| chains.iter().map(of).max().unwrap_or(0);
        let fixed = MARGINS + outline.controls + outline.states;
        let sizes = ChainSizes {
            kept: fixed + size(|chain| chain.carried),
            asked: size(|chain| chain.asked),
            said: size(|chain| chain.said),
        };
        let mut printer = Printer { outline, fixed, networks: Vec::new() };
        let deciding = chains[0].links.len();
        let outputs = [0, MARGINS + outline.controls];
        let links = chains.iter().zip(outputs);
        let links = links.flat_map(|(chain, first)| printer.links(chain, first)).collect();
        Ok(Some(Self { links, deciding, sizes, networks: printer.networks }))
    }

    /// Number of links.
    pub fn count(&self) -> usize {
        self.links.len()
    }

    /// How many of the links come before the controls are known; the others move the state.
    pub(in super::super) fn deciding(&self) -> usize {
        self.deciding
    }

    /// The networks, each once.
    pub(in super::super) fn networks(&self) -> &[Arc<Mlp>] {
        &self.networks
    }

    /// The networks that run behind a link.
    pub(in super::super) fn asks(&self, link: usize) -> &[AskShape] {
        &self.links[link].asks
    }

    /// Numbers of a trajectory that links and networks hand on.
    pub(in super::super) fn sizes(&self) -> ChainSizes {
        self.sizes
    }

    /// What the kernel of a link binds: nothing that it does not use.
    pub(super) fn bindings(&self, outline: &Outline, number: u32) -> Vec<(Slot, Access)> {
        let mut list = Kernel::Link(number).bindings(false);
        let link = &self.links[number as usize];
        if !link.asks.is_empty() {
            list.push((Slot::Asked, Access::ReadWrite));
        }
        if link.told {
            list.push((Slot::Said, Access::Read));
        }
        if outline.parameters > 0 {
            list.push((Slot::Values, Access::Constant));
        }
        list
    }

    /// The part of the kernel of a link that is its own.
    pub(super) fn link(&self, outline: &Outline, number: u32) -> String {
        let link = &self.links[number as usize];
        let declare = |slot: Slot, access: &str| {
            let (binding, name) = (slot as u32, if slot == Slot::Said { "said" } else { "asked" });
            format!(
                "@group(0) @binding({binding}) var<storage, {access}> {name}: array<vec4<f32>>;\n"
            )
        };
        let glue = [
            if link.asks.is_empty() { String::new() } else { declare(Slot::Asked, "read_write") },
            if link.told { declare(Slot::Said, "read") } else { String::new() },
            if outline.parameters > 0 { parameter_glue(outline.parameters) } else { String::new() },
            seconds_glue(outline.period, outline.points),
            load_glue(outline.states, &[]),
        ];
        [&glue.concat(), &link.text, LINK].join("\n")
    }

    /// What gives a rollout its margins and its next states: numbers that links have kept, loaded along
    /// with the state.
    pub(super) fn rollout_glue(outline: &Outline) -> String {
        let Outline { states, controls, .. } = *outline;
        let next = MARGINS + controls;
        let kept = |number: usize| format!("kept[{number}u * stride + column]");
        let numbers = (0..MARGINS).chain(next..next + states).map(kept);
        let load = load_glue(states, &numbers.collect::<Vec<_>>());
        let moved = (0..states).map(|i| format!("x[{}]", states + MARGINS + i));
        let moved: Vec<String> = moved.chain(zeros(MARGINS + states)).collect();
        let (slot, moved) = (Slot::Kept as u32, moved.join(", "));
        let none: Vec<String> = zeros(controls).collect();
        format!(
            "@group(0) @binding({slot}) var<storage, read> kept: array<f32>;\n{load}\
             fn target_at(x: array<f32, NX>, t: u32) -> f32 {{\n    return x[{states}];\n}}\n\
             fn constraint_at(x: array<f32, NX>, t: u32) -> f32 {{\n    return x[{}];\n}}\n\
             fn advance(x: array<f32, NX>, u: array<f32, NU>, t: u32) -> array<f32, NX> {{\n    \
             return array<f32, NX>({moved});\n}}\n\
             fn drive(lane: u32, column: u32, x: array<f32, NX>, t: u32) -> array<f32, NU> {{\n    \
             return array<f32, NU>({});\n}}\n",
            states + 1,
            none.join(", ")
        )
    }

    /// Length of a state in the kernels of rollouts: with margins and the next state.
    pub(super) fn state_length(outline: &Outline) -> usize {
        2 * outline.states + MARGINS
    }
}

/// So many zeros.
fn zeros(count: usize) -> impl Iterator<Item = String> {
    (0..count).map(|_| "0.0".to_owned())
}

/// Whether a formula of the plant calls a network.
fn calls_networks(model: &Model, controller: &Controller) -> bool {
    let law = match &controller.law {
        Law::Formula(graph) => [Some(graph), None],
        Law::Network { observe, act, .. } => [observe.as_ref(), act.as_ref()],
    };
    let law = law.into_iter().flatten();
    let mut all = [&model.step, &model.target, &model.constraint].into_iter().chain(law);
    all.any(|graph| !graph.calls.is_empty())
}

/// Margins and controls at a state, the network that drives being one that is called.
fn decision(model: &Model, controller: &Controller) -> Graph {
    record(model.inputs(), |inputs| {
        let margins = [&model.target, &model.constraint];
        let margins = margins.into_iter().flat_map(|margin| margin.recorded_at(inputs));
        let mut outputs: Vec<Expr> = margins.collect();
        outputs.extend(match &controller.law {
            Law::Formula(graph) => graph.recorded_at(inputs),
            Law::Network { observe, network, act } => {
                let states = || inputs[..model.states.len()].to_vec();
                let seen = observe.as_ref().map_or_else(states, |graph| graph.recorded_at(inputs));
                let said = Expr::call(network, &seen);
                match act {
                    Some(graph) => graph.recorded_at(&[inputs, &said].concat()),
                    None => said,
                }
            }
        });
        outputs
    })
}

/// Prints links, and numbers the networks that they ask.
struct Printer<'a> {
    outline: &'a Outline,
    /// Kept numbers that are no chain's own.
    fixed: usize,
    networks: Vec<Arc<Mlp>>,
}

impl Printer<'_> {
    /// The links of `chain`, whose outputs are kept from the number `first` on.
    fn links(&mut self, chain: &Chain, first: usize) -> Vec<LinkText> {
        let link = |link: &Link| LinkText {
            text: self.text(link, first),
            told: link.reads.iter().any(|place| matches!(place, Place::Said(_))),
            asks: self.asks(link),
        };
        chain.links.iter().map(link).collect()
    }

    /// The networks behind a link.
    fn asks(&mut self, link: &Link) -> Vec<AskShape> {
        let shape = |ask: &Ask| {
            let known = self.networks.iter().position(|known| known.is_same(&ask.network));
            let network = known.unwrap_or_else(|| {
                self.networks.push(Arc::clone(&ask.network));
                self.networks.len() - 1
            });
            AskShape { network, asked: ask.asked.clone(), said: ask.said.clone() }
        };
        link.asks.iter().map(shape).collect()
    }

    /// `evaluate`, and the recorded function that it calls.
    fn text(&self, link: &Link, first: usize) -> String {
        let Outline { states, controls, parameters, .. } = *self.outline;
        let sizes = [
            ("x", states),
            ("u", controls),
            ("p", parameters),
            ("seconds", 1),
            ("number", 1),
            ("handed", link.reads.len()),
        ];
        let taken: Vec<(&str, usize)> = sizes.into_iter().filter(|(_, size)| *size > 0).collect();
        let passed = |(name, size): &(&str, usize)| match (*name, *size) {
            ("p", _) => "parameters()".to_owned(),
            ("seconds", _) => "seconds_at(t)".to_owned(),
            ("number", _) => "f32(t)".to_owned(),
            (name, 1) => format!("{name}[0]"),
            (name, _) => name.to_owned(),
        };
        let passed: Vec<String> = taken.iter().map(passed).collect();
        let acting: Vec<String> = (MARGINS..MARGINS + controls)
            .map(|number| format!("kept[{number}u * row + acting]"))
            .collect();
        let mut text = careful_function("formulas", &taken, &link.graph);
        text += "fn evaluate(column: u32, x: array<f32, NX>, t: u32) {\n";
        text += "    let row = params.stride;\n";
        // Where a pair replays, both of it act as the nominal one does.
        text += "    let acting = column % params.width;\n";
        text += &format!("    let u = array<f32, NU>({});\n", acting.join(", "));
        text += &self.handed(link);
        text += &format!("    let v = formulas({});\n", passed.join(", "));
        text + &self.stores(link, first) + "}\n"
    }

    /// What the link is handed, as an array.
    fn handed(&self, link: &Link) -> String {
        let load = |place: &Place| match *place {
            Place::Asked(_) => unreachable!("what a network is asked, nobody else reads"),
            Place::Said(at) => {
                format!("said[{}u * row + column][{}]", at / 4, at % 4)
            }
            Place::Carried(at) => format!("kept[{}u * row + column]", self.fixed + at),
        };
        let loads: Vec<String> = link.reads.iter().map(load).collect();
        match loads.len() {
            0 => String::new(),
            count => format!("    let handed = array<f32, {count}>({});\n", loads.join(", ")),
        }
    }

    /// Where the values go: to networks in vectors of 4, to later links one by one.
    fn stores(&self, link: &Link, first: usize) -> String {
        let value = |i: usize| match link.graph.outputs.len() {
            1 => "v".to_owned(),
            _ => format!("v[{i}]"),
        };
        let kept =
            |at: usize, i: usize| format!("    kept[{at}u * row + column] = {};\n", value(i));
        if link.writes.is_empty() {
            return (0..link.graph.outputs.len()).map(|i| kept(first + i, i)).collect();
        }
        let asked = |at: usize| link.writes.iter().position(|place| *place == Place::Asked(at));
        let mut text = String::new();
        for quad in link.asks.iter().flat_map(|ask| ask.asked.start / 4..ask.asked.end.div_ceil(4))
        {
            let entry = |at: usize| asked(at).map_or("0.0".to_owned(), value);
            let entries: Vec<String> = (4 * quad..4 * quad + 4).map(entry).collect();
            let entries = entries.join(", ");
            text += &format!("    asked[{quad}u * row + column] = vec4<f32>({entries});\n");
        }
        for (i, place) in link.writes.iter().enumerate() {
            if let Place::Carried(at) = *place {
                text += &kept(self.fixed + at, i);
            }
        }
        text
    }
}
