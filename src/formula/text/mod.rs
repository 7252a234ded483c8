//! Formulas as text: parsed once into a list of operations with functions whole, evaluated over any
//! scalar, and so recorded as a graph.

mod fault;
mod function;
mod names;
mod networks;
mod parser;
mod term;
mod token;

pub use fault::Fault;
pub(crate) use fault::{nearest, shown};
pub use function::Function;
pub use names::Names;
pub use networks::Networks;
pub use term::{Comparison, Operation, Term, Values};
pub(crate) use token::LONGEST_NAME;

use super::Scalar;
use parser::Parser;

/// Most operations of a formula, and most nodes of the graph of a model.
pub const MOST_NODES: usize = 65_536;
/// Longest text of a model, and so of a formula, in bytes.
pub const LONGEST_TEXT: usize = 1 << 20;

/// A parsed formula: operations in order of evaluation, the last of which is its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    terms: Vec<Term>,
    /// Where each term stands in the text, in bytes.
    places: Vec<u32>,
    calls: Vec<NetworkCall>,
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

/// Something that a formula uses, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Use {
    /// The place of a name, or the number of an output.
    pub number: u32,
    /// Where it stands, in bytes.
    pub at: usize,
}

impl Formula {
    /// Parses `text`, which may use `names`, functions, `pi`, `out[i]` and `net(...)[i]`.
    ///
    /// ```
    /// use reachcast::formula::text::{Formula, Names, Networks, Values};
    /// let mut names = Names::default();
    /// names.add("x", "a state")?;
    /// let formula = Formula::parse("-x^2 + 2 * hypot(x, 4)", &names).expect("a formula");
    /// let networks = Networks::default();
    /// let values = Values { names: &[3.0_f32], outputs: &[], networks: &networks };
    /// assert_eq!(formula.value(values), 1.0);
    /// let fault = Formula::parse("1 + cosh(x)", &names).expect_err("no such function");
    /// assert_eq!(fault.problem, "unknown function `cosh`; the nearest is `cos`");
    /// # Ok::<(), String>(())
    /// ```
    ///
    /// # Errors
    /// The first fault: what was found at which place, what was expected, and the nearest name.
    pub fn parse(text: &str, names: &Names) -> Result<Self, Fault> {
        if text.len() > LONGEST_TEXT {
            let problem =
                format!("a formula of {} bytes, at most {LONGEST_TEXT} are read", text.len());
            return Err(Fault::new(0, problem));
        }
        Parser::new(text, names)?.formula()
    }

    /// Its value for `values`.
    ///
    /// # Panics
    /// If a name or output has no value, or a network is missing or has other inputs.
    pub fn value<R: Scalar>(&self, values: Values<'_, R>) -> R {
        let mut earlier: Vec<R> = Vec::with_capacity(self.terms.len());
        for term in &self.terms {
            let value = match *term {
                Term::Network(call) => self.calls[call as usize].value(values.networks, &earlier),
                term => term.value(values, &earlier),
            };
            earlier.push(value);
        }
        earlier[earlier.len() - 1]
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
