//! The words of a formula's text: numbers, names, quoted text and symbols.

use super::fault::{Fault, shown};

/// Longest name, in characters: nearest names are looked for in time that grows with its square.
pub(crate) const LONGEST_NAME: usize = 64;

/// Symbols, the longer before those that they begin with.
const SYMBOLS: [&str; 18] =
    ["<=", ">=", "==", "!=", "**", "<", ">", "=", "+", "-", "*", "/", "^", "(", ")", "[", "]", ","];

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind<'a> {
    /// A number as it is written; digits, point and exponent fit together.
    Number(&'a str),
    /// A name.
    Name(&'a str),
    /// What stands between quotes.
    Quoted(&'a str),
    /// An operator, a bracket or a comma.
    Symbol(&'static str),
    /// The end of the text.
    End,
}

/// A token and where it begins, in bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token<'a> {
    pub(super) kind: Kind<'a>,
    pub(super) at: usize,
}

impl Kind<'_> {
    /// How an error names it.
    pub(super) fn words(&self) -> String {
        match self {
            Self::Number(text) => format!("the number `{}`", shown(text)),
            Self::Name(name) => format!("the name `{}`", shown(name)),
            Self::Quoted(text) => format!("the text '{}'", shown(text)),
            Self::Symbol(symbol) => format!("`{symbol}`"),
            Self::End => "the end".to_owned(),
        }
    }
}

/// Takes a text apart, token by token.
#[derive(Debug)]
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    /// The next token; the end as often as it is asked for.
    pub(super) fn token(&mut self) -> Result<Token<'a>, Fault> {
        self.take(|c| c.is_ascii_whitespace());
        let at = self.at;
        let kind = match self.rest().chars().next() {
            None => Kind::End,
            Some(c) if c.is_ascii_digit() || c == '.' => self.number()?,
            Some(c) if starts_name(c) => self.name()?,
            Some(quote @ ('\'' | '"')) => self.quoted(quote)?,
            Some(c) => self.symbol(c)?,
        };
        Ok(Token { kind, at })
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// Goes over the characters for which `wanted` holds.
    fn take(&mut self, wanted: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let length = rest.find(|c| !wanted(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    fn number(&mut self) -> Result<Kind<'a>, Fault> {
        let start = self.at;
        let digits = |lexer: &mut Self| lexer.take(|c| c.is_ascii_digit()).len();
        let mut count = digits(self);
        if self.rest().starts_with('.') {
            self.at += 1;
            count += digits(self);
        }
        if count == 0 {
            return Err(Fault::new(start, "a `.` without digits is no number"));
        }
        self.exponent();
        Ok(Kind::Number(&self.text[start..self.at]))
    }

    /// Goes over the power of ten of a number, where one follows.
    fn exponent(&mut self) {
        let rest = self.rest();
        let Some(power) = rest.strip_prefix(['e', 'E']) else { return };
        let digits = power.strip_prefix(['+', '-']).unwrap_or(power);
        if digits.starts_with(|c: char| c.is_ascii_digit()) {
            self.at += rest.len() - digits.len();
            self.take(|c| c.is_ascii_digit());
        }
    }

    fn name(&mut self) -> Result<Kind<'a>, Fault> {
        let start = self.at;
        let name = self.take(continues_name);
        if name.len() > LONGEST_NAME {
            let problem = format!(
                "the name `{}` has {} characters, at most {LONGEST_NAME} are allowed",
                shown(name),
                name.len()
            );
            return Err(Fault::new(start, problem));
        }
        Ok(Kind::Name(name))
    }

    fn quoted(&mut self, quote: char) -> Result<Kind<'a>, Fault> {
        let start = self.at;
        self.at += 1;
        let inside = self.take(|c| c != quote);
        if self.rest().is_empty() {
            return Err(Fault::new(start, format!("no closing {quote} for this one")));
        }
        self.at += 1;
        Ok(Kind::Quoted(inside))
    }

    fn symbol(&mut self, first: char) -> Result<Kind<'a>, Fault> {
        let rest = self.rest();
        let found = SYMBOLS.into_iter().find(|symbol| rest.starts_with(symbol));
        let symbol = found.ok_or_else(|| {
            let problem = format!("`{}` has no meaning in a formula", first.escape_debug());
            Fault::new(self.at, problem)
        })?;
        self.at += symbol.len();
        Ok(Kind::Symbol(symbol))
    }
}

/// Whether a name may begin with `c`.
fn starts_name(c: char) -> bool {
    c.is_ascii_alphabetic() || c == '_'
}

/// Whether a name may go on with `c`.
fn continues_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Whether `text` can be named in a formula.
pub(crate) fn is_name(text: &str) -> bool {
    text.starts_with(starts_name) && text.chars().all(continues_name) && text.len() <= LONGEST_NAME
}
