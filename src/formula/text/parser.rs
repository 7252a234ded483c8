//! From text to terms: recursive descent, weak operators first, and a limit to its depth.

mod asked;

use super::fault::{Fault, nearest};
use super::formula::{Formula, Lookup, MOST_NODES, NetworkCall};
use super::function::Function;
use super::names::Names;
use super::networks::Networks;
use super::term::{Comparison, Operation, Term, Values};
use super::token::{Kind, Lexer, Token};

/// Deepest nesting of brackets, signs and powers.
const DEEPEST: usize = 256;

/// A formula on its way from text to terms.
pub(super) struct Parser<'a> {
    lexer: Lexer<'a>,
    /// The token that is looked at.
    next: Token<'a>,
    names: &'a Names,
    depth: usize,
    terms: Vec<Term>,
    /// Where each term stands, in bytes.
    places: Vec<u32>,
    /// The value of each term that no name enters, NaN of the others.
    constants: Vec<f32>,
    /// Whether no name enters a term.
    fixed: Vec<bool>,
    calls: Vec<NetworkCall>,
    lookups: Vec<Lookup>,
    /// None: what is fixed calls no network.
    networks: Networks,
}

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str, names: &'a Names) -> Result<Self, Fault> {
        let mut lexer = Lexer::new(text);
        let next = lexer.token()?;
        Ok(Self {
            lexer,
            next,
            names,
            depth: 0,
            terms: Vec::new(),
            places: Vec::new(),
            constants: Vec::new(),
            fixed: Vec::new(),
            calls: Vec::new(),
            lookups: Vec::new(),
            networks: Networks::default(),
        })
    }

    /// The formula, which takes the whole text.
    pub(super) fn formula(mut self) -> Result<Formula, Fault> {
        self.sum()?;
        match self.next.kind {
            Kind::End => {
                let Self { terms, places, calls, lookups, .. } = self;
                Ok(Formula { terms, places, calls, lookups })
            }
            Kind::Symbol(symbol) if Comparison::of(symbol).is_some() => Err(self.fault(format!(
                "`{symbol}` stands outside a condition; comparisons stand in `if(a < b, yes, no)`"
            ))),
            _ => Err(self.unexpected("an operator or the end")),
        }
    }

    fn fault(&self, problem: impl Into<String>) -> Fault {
        Fault::new(self.next.at, problem)
    }

    /// The refusal of the token that is looked at.
    fn unexpected(&self, expected: &str) -> Fault {
        let hint = match self.next.kind {
            Kind::Symbol("**") => "; a power is written with `^`",
            Kind::Symbol("=") => "; equality is `==`, in the condition of an `if`",
            _ => "",
        };
        self.fault(format!("expected {expected}, found {}{hint}", self.next.kind.words()))
    }

    /// Goes on to the next token and returns the one before.
    fn advance(&mut self) -> Result<Token<'a>, Fault> {
        let after = self.lexer.token()?;
        Ok(std::mem::replace(&mut self.next, after))
    }

    /// Whether `symbol` comes next; if so, it is taken.
    fn accept(&mut self, symbol: &str) -> Result<bool, Fault> {
        let here = matches!(self.next.kind, Kind::Symbol(found) if found == symbol);
        if here {
            self.advance()?;
        }
        Ok(here)
    }

    fn expect(&mut self, symbol: &str) -> Result<(), Fault> {
        if self.accept(symbol)? {
            return Ok(());
        }
        Err(self.unexpected(&format!("`{symbol}`")))
    }

    /// Adds a term that stands at byte `at`; its index.
    fn add(&mut self, term: Term, at: usize) -> Result<u32, Fault> {
        if self.terms.len() == MOST_NODES {
            let problem = format!("more than {MOST_NODES} operations in one formula");
            return Err(Fault::new(at, problem));
        }
        let fixed = self.is_fixed(term);
        let networks = &self.networks;
        let none = Values { names: &[], outputs: &[], looked: &[], networks };
        self.constants.push(if fixed { term.value(none, &self.constants) } else { f32::NAN });
        self.fixed.push(fixed);
        self.terms.push(term);
        self.places.push(at as u32);
        Ok((self.terms.len() - 1) as u32)
    }

    /// Whether numbers alone enter `term`.
    fn is_fixed(&self, term: Term) -> bool {
        let mut fixed =
            !matches!(term, Term::Name(_) | Term::Output(_) | Term::Network(_) | Term::Looked(_));
        term.operands(|i| fixed &= self.fixed[i as usize]);
        fixed
    }

    /// The value of the term `i`, where numbers alone enter it.
    fn known(&self, i: u32) -> Option<f32> {
        self.fixed[i as usize].then(|| self.constants[i as usize])
    }

    /// Runs `inner` one level deeper.
    fn nested<T>(&mut self, inner: impl FnOnce(&mut Self) -> Result<T, Fault>) -> Result<T, Fault> {
        if self.depth == DEEPEST {
            return Err(self.fault(format!("nested deeper than {DEEPEST} levels")));
        }
        self.depth += 1;
        let result = inner(self);
        self.depth -= 1;
        result
    }

    /// Sums and differences, from left to right.
    fn sum(&mut self) -> Result<u32, Fault> {
        self.nested(|parser| {
            let operations = [("+", Operation::Add), ("-", Operation::Sub)];
            parser.chain(operations, Self::product)
        })
    }

    /// Products and quotients, from left to right.
    fn product(&mut self) -> Result<u32, Fault> {
        self.chain([("*", Operation::Mul), ("/", Operation::Div)], Self::signed)
    }

    /// Operands with operations of one strength between them.
    fn chain(
        &mut self,
        operations: [(&str, Operation); 2],
        operand: fn(&mut Self) -> Result<u32, Fault>,
    ) -> Result<u32, Fault> {
        let mut left = operand(self)?;
        loop {
            let at = self.next.at;
            let [first, second] = operations;
            let operation = if self.accept(first.0)? {
                first.1
            } else if self.accept(second.0)? {
                second.1
            } else {
                return Ok(left);
            };
            let right = operand(self)?;
            left = self.add(Term::Binary(operation, left, right), at)?;
        }
    }

    /// A power with any number of signs in front.
    fn signed(&mut self) -> Result<u32, Fault> {
        let at = self.next.at;
        if !self.accept("-")? {
            return self.power();
        }
        let operand = self.nested(Self::signed)?;
        match self.terms.last_mut() {
            // A negative number is one literal, as in any other language.
            Some(Term::Number(number)) => {
                *number = -*number;
                self.constants[operand as usize] *= -1.0;
                Ok(operand)
            }
            _ => self.add(Term::Negative(operand), at),
        }
    }

    /// A number, name or bracket, to a power where one follows.
    fn power(&mut self) -> Result<u32, Fault> {
        let base = self.primary()?;
        let at = self.next.at;
        if !self.accept("^")? {
            return Ok(base);
        }
        let exponent = self.exponent()?;
        self.add(Term::Power(base, exponent), at)
    }

    /// The number to the right of `^`; its terms go, as nothing refers to them.
    fn exponent(&mut self) -> Result<f32, Fault> {
        let at = self.next.at;
        let before = self.terms.len();
        let exponent = self.nested(Self::signed)?;
        let refused = |problem: String| Err(Fault::new(at, problem));
        match self.known(exponent) {
            None => refused(
                "an exponent is a number, not a formula of names; `exp(y * log(x))` is x to the y"
                    .to_owned(),
            ),
            Some(value) if !value.is_finite() => {
                refused(format!("the exponent is {value}, expected a finite number"))
            }
            Some(value) => {
                self.terms.truncate(before);
                self.places.truncate(before);
                self.constants.truncate(before);
                self.fixed.truncate(before);
                Ok(value)
            }
        }
    }

    fn primary(&mut self) -> Result<u32, Fault> {
        let at = self.next.at;
        match self.next.kind {
            Kind::Number(text) => {
                self.advance()?;
                // Digits, point and exponent always are a number; too large a one is infinite.
                self.add(Term::Number(text.parse().unwrap_or(f32::NAN)), at)
            }
            Kind::Name(name) => {
                self.advance()?;
                self.named(name, at)
            }
            Kind::Symbol("(") => {
                self.advance()?;
                let inside = self.sum()?;
                self.expect(")")?;
                Ok(inside)
            }
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    /// What begins with `name`, which stands at byte `at`.
    fn named(&mut self, name: &str, at: usize) -> Result<u32, Fault> {
        if self.accept("(")? {
            return self.call(name, at);
        }
        if name == "out" {
            let index = self.index()?;
            return self.add(Term::Output(index), at);
        }
        if name == "pi" {
            return self.add(Term::Number(std::f32::consts::PI), at);
        }
        let place = self.names.place(name).ok_or_else(|| self.unknown(name, at))?;
        self.add(Term::Name(place), at)
    }

    /// The refusal of a name that stands for nothing.
    fn unknown(&self, name: &str, at: usize) -> Fault {
        if Function::names().any(|function| function == name) {
            return Fault::new(at, format!("`{name}` is a function: expected `{name}(...)`"));
        }
        if self.names.map(name).is_some() {
            return Fault::new(at, format!("`{name}` is a map: expected `{name}(x, y)`"));
        }
        let problem = match name {
            "t" => "`t`, the time in seconds, needs `period` in `[model.time]`".to_owned(),
            _ => format!("unknown name `{name}`; the nearest is `{}`", self.names.nearest(name)),
        };
        Fault::new(at, problem)
    }

    /// The call of `name`, whose bracket is open.
    fn call(&mut self, name: &str, at: usize) -> Result<u32, Fault> {
        match (name, Function::named(name)) {
            ("if", _) => self.condition(at),
            ("net", _) => self.network(at),
            (_, None) if self.names.map(name).is_some() => self.lookup(name, at),
            (_, Some(function)) => self.function(function, at),
            (_, None) if self.names.place(name).is_some() => Err(Fault::new(
                at,
                format!("`{name}` is no function; a product is written with `*`"),
            )),
            (_, None) => {
                let mut known: Vec<&str> = Function::names().collect();
                known.extend(self.names.maps().iter().map(String::as_str));
                let nearest = nearest(name, known.into_iter()).unwrap_or("abs");
                let problem = format!("unknown function `{name}`; the nearest is `{nearest}`");
                Err(Fault::new(at, problem))
            }
        }
    }

    fn function(&mut self, function: Function, at: usize) -> Result<u32, Fault> {
        let arguments = self.arguments()?;
        let (name, expected) = (function.name(), function.arguments());
        if arguments.len() != expected {
            let found = arguments.len();
            let problem = format!("`{name}` takes {}, found {found}", counted(expected));
            return Err(Fault::new(at, problem));
        }
        if let [only] = arguments[..]
            && let Some(value) = self.known(only).filter(|value| function.is_undefined_at(*value))
        {
            return Err(Fault::new(at, format!("`{name}` of {value} is not a number")));
        }
        let operand = |i: usize| arguments.get(i).copied().unwrap_or(arguments[0]);
        self.add(Term::Call(function, [operand(0), operand(1), operand(2)]), at)
    }

    /// Arguments up to the closing bracket.
    fn arguments(&mut self) -> Result<Vec<u32>, Fault> {
        let mut arguments = Vec::new();
        if self.accept(")")? {
            return Ok(arguments);
        }
        loop {
            arguments.push(self.sum()?);
            if self.accept(")")? {
                return Ok(arguments);
            }
            if !self.accept(",")? {
                return Err(self.unexpected("an operator, `,` or `)`"));
            }
        }
    }

    /// `a < b, yes, no)`, the rest of an `if`.
    fn condition(&mut self, at: usize) -> Result<u32, Fault> {
        let a = self.sum()?;
        let comparison = match self.next.kind {
            Kind::Symbol(symbol) => Comparison::of(symbol),
            _ => None,
        };
        let comparison = comparison
            .ok_or_else(|| self.unexpected("a comparison (`<`, `<=`, `>`, `>=`, `==` or `!=`)"))?;
        self.advance()?;
        let b = self.sum()?;
        self.expect(",")?;
        let yes = self.sum()?;
        self.expect(",")?;
        let no = self.sum()?;
        self.expect(")")?;
        self.add(Term::If(comparison, [a, b, yes, no]), at)
    }
}

/// `1 argument`, `2 arguments`.
fn counted(arguments: usize) -> String {
    format!("{arguments} argument{}", if arguments == 1 { "" } else { "s" })
}
