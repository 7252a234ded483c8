//! A parsed formula: evaluated over any scalar, and asked what it uses.

use super::networks::Networks;
use super::term::{Term, Values};
use crate::formula::Scalar;

/// Most operations of a formula, and most nodes of the graph of a model.
pub const MOST_NODES: usize = 65_536;
/// A parsed formula: operations in order of evaluation, the last of which is its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    pub(super) terms: Vec<Term>,
    /// Where each term stands in the text, in bytes.
    pub(super) places: Vec<u32>,
    pub(super) calls: Vec<NetworkCall>,
    pub(super) lookups: Vec<Lookup>,
}

/// A network that a formula calls like a function.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkCall {
    /// The file, as the formula writes it.
    pub file: String,
    /// The terms that are its inputs.
    pub arguments: Vec<u32>,
    /// Which of its outputs is meant.
    pub output: u32,
    /// Where the call stands, in bytes.
    pub at: usize,
}

impl NetworkCall {
    /// Its value, given those of the `earlier` terms.
    fn value<R: Scalar>(&self, networks: &Networks, earlier: &[R]) -> R {
        let inputs: Vec<R> = self.arguments.iter().map(|i| earlier[*i as usize]).collect();
        R::call(networks.of(&self.file), &inputs)[self.output as usize]
    }
}

/// A map that a formula asks like a function.
#[derive(Clone, Debug, PartialEq)]
pub struct Lookup {
    /// The number of the map.
    pub map: u32,
    /// The terms that are the coordinates.
    pub arguments: [u32; 2],
    /// Where it stands, in bytes.
    pub at: usize,
}

/// Something that a formula uses, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Use {
    /// The place of a name, or the number of an output.
    pub number: u32,
    /// Where it stands, in bytes.
    pub at: usize,
}

impl Formula {
    /// Its value for `values`.
    ///
    /// # Panics
    /// If a name or output has no value, or a network is missing or has other inputs.
    pub fn value<R: Scalar>(&self, values: Values<'_, R>) -> R {
        let earlier = self.all(values);
        earlier[earlier.len() - 1]
    }

    /// The point where each lookup asks its map; what maps say enters none of them.
    ///
    /// # Panics
    /// As [`Formula::value`].
    pub fn places<R: Scalar>(&self, values: Values<'_, R>) -> Vec<[R; 2]> {
        let looked = vec![R::lit(0.0); self.lookups.len()];
        let earlier = self.all(Values { looked: &looked, ..values });
        let place = |lookup: &Lookup| lookup.arguments.map(|i| earlier[i as usize]);
        self.lookups.iter().map(place).collect()
    }

    /// The values of all terms.
    fn all<R: Scalar>(&self, values: Values<'_, R>) -> Vec<R> {
        let mut earlier: Vec<R> = Vec::with_capacity(self.terms.len());
        for term in &self.terms {
            let value = match *term {
                Term::Network(call) => self.calls[call as usize].value(values.networks, &earlier),
                term => term.value(values, &earlier),
            };
            earlier.push(value);
        }
        earlier
    }

    /// The number of its operations.
    pub fn operations(&self) -> usize {
        self.terms.len()
    }

    /// The names that it uses, by their places.
    pub fn names(&self) -> impl Iterator<Item = Use> {
        self.uses(|term| match term {
            Term::Name(place) => Some(place),
            _ => None,
        })
    }

    /// The outputs of the policy's network that it uses.
    pub fn outputs(&self) -> impl Iterator<Item = Use> {
        self.uses(|term| match term {
            Term::Output(i) => Some(i),
            _ => None,
        })
    }

    /// The networks that it calls.
    pub fn networks(&self) -> &[NetworkCall] {
        &self.calls
    }

    /// The maps that it asks.
    pub fn lookups(&self) -> &[Lookup] {
        &self.lookups
    }

    /// The name that the whole formula is.
    pub fn only_name(&self) -> Option<u32> {
        match self.terms[..] {
            [Term::Name(place)] => Some(place),
            _ => None,
        }
    }

    fn uses(&self, number: fn(Term) -> Option<u32>) -> impl Iterator<Item = Use> {
        let both = self.terms.iter().zip(&self.places);
        both.filter_map(move |(term, at)| {
            number(*term).map(|number| Use { number, at: *at as usize })
        })
    }
}
