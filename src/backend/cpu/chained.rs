//! Formulas that call networks, over the rows of a tile: tapes, and packed networks between them.

use std::ops::Range;
use std::sync::Arc;

use super::dispatch::run;
use super::mlp::{Between, Packed};
use crate::formula::{Chain, Graph, Place};
use crate::policy::Mlp;
use crate::real::simd::Instructions;
use crate::tile::{Frame, Source, Tape};

/// What packs a network for the kernel.
pub(super) type Pack<'a> = &'a dyn Fn(&Mlp) -> Arc<Packed>;

/// A formula as tapes with networks between them; one tape where it calls none.
#[derive(Debug)]
pub(super) struct Chained {
    links: Vec<Link>,
    own: usize,
}

/// A tape, and the networks that run behind it.
#[derive(Debug)]
struct Link {
    tape: Tape,
    asks: Vec<Ask>,
}

/// A packed network, and the rows of its inputs and of its outputs.
#[derive(Debug)]
struct Ask {
    network: Arc<Packed>,
    rows: [Range<usize>; 2],
}

impl Chained {
    /// The formulas `graphs`, one after the other, as for [`Tape::new`]: what lies between is in
    /// rows from `first_own` on. Their networks are packed by `pack`.
    pub(super) fn new(
        graphs: &[&Graph],
        sources: &[Source],
        outputs: &[usize],
        first_own: usize,
        pack: Pack<'_>,
    ) -> Self {
        if graphs.iter().all(|graph| graph.calls.is_empty()) {
            let tape = Tape::new(graphs, sources, outputs, first_own);
            let own = tape.own_rows();
            return Self { links: vec![Link { tape, asks: Vec::new() }], own };
        }
        let chain = Chain::new(&Graph::joined(graphs));
        let rows = Rows::new(&chain, first_own);
        let links: Vec<Link> =
            chain.links.iter().map(|link| rows.link(link, sources, outputs, pack)).collect();
        let own = links.iter().map(|link| link.tape.own_rows()).max().unwrap_or(0);
        Self { links, own: own + rows.end - first_own }
    }

    /// How many rows of its own it needs.
    pub(super) fn own_rows(&self) -> usize {
        self.own
    }

    /// Whether it reads a row, as far as it was given.
    pub(super) fn reads(&self, row: usize) -> bool {
        self.links.iter().any(|link| link.tape.reads(row))
    }

    /// Widest layer of its networks; `None` if it calls none.
    pub(super) fn widest(&self) -> Option<usize> {
        let networks = self.links.iter().flat_map(|link| &link.asks);
        networks.map(|ask| ask.network.widest()).max()
    }

    /// Evaluates it for the first `lanes` trajectories.
    pub(super) fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        for Link { tape, asks } in &self.links {
            tape.evaluate(with, frame, lanes);
            for Ask { network, rows } in asks {
                run(with, Between { network, frame, rows: rows.clone(), lanes });
            }
        }
    }
}

/// The rows of the places of a chain.
struct Rows {
    asked: usize,
    said: usize,
    carried: usize,
    /// The first one that tapes have to themselves.
    end: usize,
}

impl Rows {
    /// From row `first` on.
    fn new(chain: &Chain, first: usize) -> Self {
        let [said, carried] = [first + chain.asked, first + chain.asked + chain.said];
        Self { asked: first, said, carried, end: carried + chain.carried }
    }

    /// The row of a place.
    fn of(&self, place: Place) -> usize {
        match place {
            Place::Asked(at) => self.asked + at,
            Place::Said(at) => self.said + at,
            Place::Carried(at) => self.carried + at,
        }
    }

    /// A link over the rows of a tile; the last one writes the outputs of the formula.
    fn link(
        &self,
        link: &crate::formula::Link,
        sources: &[Source],
        outputs: &[usize],
        pack: Pack<'_>,
    ) -> Link {
        let reads = link.reads.iter().map(|place| Source::Row(self.of(*place)));
        let sources: Vec<Source> = sources.iter().copied().chain(reads).collect();
        let writes: Vec<usize> = link.writes.iter().map(|place| self.of(*place)).collect();
        let to = if writes.is_empty() { outputs } else { &writes };
        let rows = |places: &Range<usize>, first: usize| first + places.start..first + places.end;
        let ask = |ask: &crate::formula::Ask| Ask {
            network: pack(&ask.network),
            rows: [rows(&ask.asked, self.asked), rows(&ask.said, self.said)],
        };
        let tape = Tape::new(&[&link.graph], &sources, to, self.end);
        Link { tape, asks: link.asks.iter().map(ask).collect() }
    }
}
