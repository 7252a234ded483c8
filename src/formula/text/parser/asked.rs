//! What formulas ask others for: outputs of networks, cells of maps.

use super::super::fault::Fault;
use super::super::formula::{Lookup, NetworkCall};
use super::super::term::Term;
use super::super::token::Kind;
use super::Parser;

impl Parser<'_> {
    /// `'file', arguments...)[output]`, the rest of a `net`.
    pub(super) fn network(&mut self, at: usize) -> Result<u32, Fault> {
        let Kind::Quoted(file) = self.next.kind else {
            return Err(self.unexpected("the file of a network between quotes"));
        };
        self.advance()?;
        let arguments = if self.accept(",")? {
            self.arguments()?
        } else {
            self.expect(")")?;
            Vec::new()
        };
        let output = self.index()?;
        self.calls.push(NetworkCall { file: file.to_owned(), arguments, output, at });
        self.add(Term::Network((self.calls.len() - 1) as u32), at)
    }

    /// `x, y)`, the rest of what asks the map `name`.
    pub(super) fn lookup(&mut self, name: &str, at: usize) -> Result<u32, Fault> {
        let before = self.terms.len();
        let arguments = self.arguments()?;
        let Ok(arguments) = <[u32; 2]>::try_from(arguments) else {
            let problem = format!("`{name}` is a map and takes 2 coordinates: `{name}(x, y)`");
            return Err(Fault::new(at, problem));
        };
        if self.terms[before..].iter().any(|term| matches!(term, Term::Looked(_))) {
            let problem = format!(
                "the place on the map `{name}` asks a map itself; it is of states, references and time"
            );
            return Err(Fault::new(at, problem));
        }
        let map = self.names.map(name).unwrap_or_default();
        self.lookups.push(Lookup { map, arguments, at });
        self.add(Term::Looked((self.lookups.len() - 1) as u32), at)
    }

    /// `[number]`.
    pub(super) fn index(&mut self) -> Result<u32, Fault> {
        self.expect("[")?;
        let whole = match self.next.kind {
            Kind::Number(text) => text.parse().ok(),
            _ => None,
        };
        let index = whole.ok_or_else(|| self.unexpected("the number of an output, from 0"))?;
        self.advance()?;
        self.expect("]")?;
        Ok(index)
    }
}
