//! A formula that calls networks as a chain: formulas, the networks that they ask, formulas again.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;

use super::call::Call;
use super::node::Node;
use super::recorder::{Expr, Graph, record};
use crate::policy::{Mlp, Parts};

/// Numbers that a network's inputs and outputs lie at multiples of: kernels take vectors of them.
const ROOM: usize = 8;

/// A formula cut at its networks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chain {
    /// At least one; the networks of a link run before the next one.
    pub(crate) links: Vec<Link>,
    /// Places for what networks are asked.
    pub(crate) asked: usize,
    /// Places for what they say.
    pub(crate) said: usize,
    /// Places for what a later link needs.
    pub(crate) carried: usize,
}

/// A part of a formula without networks, and the networks that run behind it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    /// Its inputs are those of the formula and `reads`; its outputs go to `writes`, those of the last
    /// link are the formula's.
    pub(crate) graph: Graph,
    /// Where its further inputs are.
    pub(crate) reads: Vec<Place>,
    /// Where its outputs go; it reads all before it writes any.
    pub(crate) writes: Vec<Place>,
    /// The networks that run behind it.
    pub(crate) asks: Vec<Ask>,
}

/// A number that links and networks hand on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// An input of a network, until it has run.
    Asked(usize),
    /// An output of a network, for the next link alone.
    Said(usize),
    /// A number for later links.
    Carried(usize),
}

/// A network between two links.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ask {
    /// The network.
    pub(crate) network: Arc<Mlp>,
    /// Places of its inputs.
    pub(crate) asked: Range<usize>,
    /// Places of its outputs.
    pub(crate) said: Range<usize>,
}

impl Graph {
    /// Its outputs at `inputs`, as part of the recording in progress.
    ///
    /// # Panics
    /// If the number of inputs is not the graph's.
    pub(crate) fn recorded_at(&self, inputs: &[Expr]) -> Vec<Expr> {
        let mut values = Vec::with_capacity(self.nodes.len());
        self.replay_with(inputs, &mut values, super::Scalar::call);
        self.outputs.iter().map(|i| values[*i as usize]).collect()
    }

    /// The same graph with the maps at the ends of the networks that it calls as operations of its own.
    fn unmapped(&self) -> Self {
        record(self.inputs, |inputs| {
            let mut values = Vec::with_capacity(self.nodes.len());
            self.replay_with(inputs, &mut values, |network, arguments| {
                let Parts { input, core, output } = network.parts();
                let seen = input.map_or_else(|| arguments.to_vec(), |map| map.apply(arguments));
                let said = super::Scalar::call(&core, &seen);
                output.map_or_else(|| said.clone(), |map| map.apply(&said))
            });
            self.outputs.iter().map(|i| values[*i as usize]).collect()
        })
    }

    /// One graph with the outputs of all `graphs`, which have the same inputs.
    ///
    /// # Panics
    /// If they have not.
    pub(crate) fn joined(graphs: &[&Self]) -> Self {
        let inputs = graphs.first().map_or(0, |graph| graph.inputs);
        record(inputs, |x| graphs.iter().flat_map(|graph| graph.recorded_at(x)).collect())
    }
}

impl Chain {
    /// `graph` in as few links as its networks allow.
    pub(crate) fn new(graph: &Graph) -> Self {
        match graph.calls.iter().any(|call| call.network.is_mapped()) {
            true => Self::of(&graph.unmapped()),
            false => Self::of(graph),
        }
    }

    /// The same of a graph whose networks have no maps.
    fn of(graph: &Graph) -> Self {
        let levels = Levels::new(graph);
        let (rooms, [asked, said]) = rooms(graph, &levels);
        let mut computed = vec![Vec::new(); levels.last + 1];
        let free = |node: &u32| is_free(graph, *node);
        for node in (0..graph.nodes.len() as u32).filter(|node| !free(node)) {
            computed[levels.of[node as usize]].push(node);
        }
        let (carried, slots) = (BTreeMap::new(), Slots::default());
        let mut forge = Forge { graph, levels: &levels, rooms: &rooms, carried, slots };
        let links = computed.iter().enumerate();
        let links = links.map(|(level, computed)| forge.link(level, computed)).collect();
        Self { links, asked, said, carried: forge.slots.count }
    }
}

/// Which link computes each node, and which link needs it last.
struct Levels {
    /// Of each node.
    of: Vec<usize>,
    /// Of the last link that needs it.
    ends: Vec<usize>,
    /// Of the link that each call comes behind.
    calls: Vec<usize>,
    /// Of the last link.
    last: usize,
}

impl Levels {
    fn new(graph: &Graph) -> Self {
        let count = graph.nodes.len();
        let mut of = vec![0; count];
        let mut calls = vec![0; graph.calls.len()];
        for (i, node) in graph.nodes.iter().enumerate() {
            let mut level = 0;
            graph.operands(i as u32, |operand| level = level.max(of[operand as usize]));
            if let Node::Said(call, _) = *node {
                calls[call as usize] = level;
                level += 1;
            }
            of[i] = level;
        }
        let last = of.iter().copied().max().unwrap_or(0);
        let mut levels = Self { of, ends: vec![0; count], calls, last };
        levels.settle(graph);
        levels
    }

    /// Moves each node to the first link that needs it, where that hands on no more numbers, and notes
    /// the last link that does.
    fn settle(&mut self, graph: &Graph) {
        let count = graph.nodes.len();
        let mut first = vec![self.last; count];
        graph.outputs.iter().for_each(|output| self.ends[*output as usize] = self.last);
        for (i, node) in graph.nodes.iter().enumerate().rev() {
            let mut handed = 0;
            graph.operands(i as u32, |at| handed += usize::from(!is_free(graph, at)));
            let user = match *node {
                Node::Said(call, _) => self.calls[call as usize],
                _ if handed > 1 => self.of[i],
                _ => first[i],
            };
            if !matches!(node, Node::Said(..)) {
                self.of[i] = user;
            }
            graph.operands(i as u32, |operand| {
                let operand = operand as usize;
                first[operand] = first[operand].min(user);
                self.ends[operand] = self.ends[operand].max(user);
            });
        }
    }
}

/// Whether any link has the node without being handed it.
fn is_free(graph: &Graph, node: u32) -> bool {
    matches!(graph.nodes[node as usize], Node::Input(_) | Node::Literal(_))
}

/// The places of each call, and how many there are of inputs and outputs: those of one link lie one
/// after the other, the next link's take their places.
fn rooms(graph: &Graph, levels: &Levels) -> (Vec<[Range<usize>; 2]>, [usize; 2]) {
    let mut ends = vec![[0; 2]; levels.last + 1];
    let calls = graph.calls.iter().zip(&levels.calls);
    let room = |(call, level): (&Call, &usize)| {
        let sizes = [call.arguments.len(), call.outputs()];
        std::array::from_fn(|side| {
            let end = &mut ends[*level][side];
            let start = *end;
            *end = (start + sizes[side]).next_multiple_of(ROOM);
            start..start + sizes[side]
        })
    };
    let rooms = calls.map(room).collect();
    let most = |side: usize| ends.iter().map(|end| end[side]).max().unwrap_or(0);
    (rooms, [most(0), most(1)])
}

/// Places of carried numbers.
#[derive(Default)]
struct Slots {
    free: Vec<usize>,
    count: usize,
}

impl Slots {
    fn take(&mut self) -> usize {
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }
}

/// What makes links of a graph, one after the other.
struct Forge<'a> {
    graph: &'a Graph,
    levels: &'a Levels,
    rooms: &'a [[Range<usize>; 2]],
    /// The place of each number that is handed on now.
    carried: BTreeMap<u32, usize>,
    slots: Slots,
}

/// A link as far as it is made.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    reads: Vec<Place>,
    /// Its node of each node of the whole graph.
    of: HashMap<u32, u32>,
}

impl Forge<'_> {
    /// The link of `level`, which computes the nodes `computed`.
    fn link(&mut self, level: usize, computed: &[u32]) -> Link {
        let mut part = Part::default();
        computed.iter().for_each(|node| _ = self.node(&mut part, *node));
        let (mut outputs, mut writes, mut asks) = (Vec::new(), Vec::new(), Vec::new());
        for (call, [asked, said]) in self.calls(level) {
            let inputs = call.arguments.iter().map(|node| self.node(&mut part, *node));
            outputs.extend(inputs);
            writes.extend(asked.clone().map(Place::Asked));
            let (asked, said) = (asked.clone(), said.clone());
            asks.push(Ask { network: Arc::clone(&call.network), asked, said });
        }
        if level == self.levels.last {
            outputs.extend(self.graph.outputs.iter().map(|node| self.node(&mut part, *node)));
        }
        for (node, slot) in self.hand_on(level, computed) {
            outputs.push(self.node(&mut part, node));
            writes.push(Place::Carried(slot));
        }
        let Part { nodes, reads, .. } = part;
        let inputs = self.graph.inputs + reads.len();
        Link { graph: Graph { inputs, nodes, outputs, calls: Vec::new() }, reads, writes, asks }
    }

    /// The calls behind the link of `level`, with their places.
    fn calls(&self, level: usize) -> impl Iterator<Item = (&Call, &[Range<usize>; 2])> {
        let all = self.graph.calls.iter().zip(self.rooms).zip(&self.levels.calls);
        all.filter(move |(_, of)| **of == level).map(|(call, _)| call)
    }

    /// The node of `part` that is `node` of the whole graph: computed there, or handed to it.
    fn node(&self, part: &mut Part, node: u32) -> u32 {
        if let Some(known) = part.of.get(&node) {
            return *known;
        }
        let handed = self.carried.get(&node).map(|slot| Place::Carried(*slot));
        let new = match (handed, self.graph.nodes[node as usize]) {
            (Some(place), _) => part.read(self.graph.inputs, place),
            (None, Node::Said(call, output)) => {
                let [_, said] = &self.rooms[call as usize];
                part.read(self.graph.inputs, Place::Said(said.start + output as usize))
            }
            (None, own) => own.renumbered(|operand| self.node(part, operand)),
        };
        part.nodes.push(new);
        let index = part.nodes.len() as u32 - 1;
        part.of.insert(node, index);
        index
    }

    /// Takes places back from numbers that no later link needs, and gives places to those of
    /// `computed` that one does.
    fn hand_on(&mut self, level: usize, computed: &[u32]) -> Vec<(u32, usize)> {
        let Self { carried, slots, levels, .. } = self;
        carried.retain(|node, slot| {
            let needed = levels.ends[*node as usize] > level;
            if !needed {
                slots.free.push(*slot);
            }
            needed
        });
        let needed = computed.iter().filter(|node| levels.ends[**node as usize] > level);
        let handed: Vec<(u32, usize)> = needed.map(|node| (*node, slots.take())).collect();
        carried.extend(handed.iter().copied());
        handed
    }
}

impl Part {
    /// A further input, from `place`.
    fn read(&mut self, inputs: usize, place: Place) -> Node {
        self.reads.push(place);
        Node::Input((inputs + self.reads.len() - 1) as u32)
    }
}

#[cfg(test)]
mod tests;
