//! The operations of a parsed formula, and their values over any scalar.

use super::function::{Function, power};
use super::networks::Networks;
use crate::real::Real;

/// One operation of a formula; operands are indices of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// A number.
    Number(f32),
    /// The name of that place.
    Name(u32),
    /// That output of the policy's network.
    Output(u32),
    /// Negation.
    Negative(u32),
    /// An operation on two.
    Binary(Operation, u32, u32),
    /// The power of a number that is fixed.
    Power(u32, f32),
    /// A function of its first operands, as many as it takes.
    Call(Function, [u32; 3]),
    /// `if(a < b, yes, no)`, in this order.
    If(Comparison, [u32; 4]),
    /// An output of a network: the call of that number in the formula.
    Network(u32),
    /// What a map says: the lookup of that number in the formula.
    Looked(u32),
}

/// An operation on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Sum.
    Add,
    /// Difference.
    Sub,
    /// Product.
    Mul,
    /// Quotient.
    Div,
}

/// How two numbers are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// `<`.
    Less,
    /// `<=`.
    LessOrEqual,
    /// `>`.
    Greater,
    /// `>=`.
    GreaterOrEqual,
    /// `==`.
    Equal,
    /// `!=`.
    NotEqual,
}

impl Comparison {
    /// The comparison that `symbol` stands for.
    pub(super) fn of(symbol: &str) -> Option<Self> {
        Some(match symbol {
            "<" => Self::Less,
            "<=" => Self::LessOrEqual,
            ">" => Self::Greater,
            ">=" => Self::GreaterOrEqual,
            "==" => Self::Equal,
            "!=" => Self::NotEqual,
            _ => return None,
        })
    }

    /// `yes` where `a` and `b` compare so, else `no`.
    fn choose<R: Real>(self, [a, b, yes, no]: [R; 4]) -> R {
        match self {
            Self::Less => a.if_lt(b, yes, no),
            Self::Greater => b.if_lt(a, yes, no),
            Self::LessOrEqual => b.if_lt(a, no, yes),
            Self::GreaterOrEqual => a.if_lt(b, no, yes),
            Self::Equal => a.if_lt(b, no, b.if_lt(a, no, yes)),
            Self::NotEqual => a.if_lt(b, yes, b.if_lt(a, yes, no)),
        }
    }
}

/// What the names and outputs of a formula stand for.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a, R> {
    /// The value of each name, by its place.
    pub names: &'a [R],
    /// The outputs of the policy's network.
    pub outputs: &'a [R],
    /// What the maps say, one for each lookup of the formula.
    pub looked: &'a [R],
    /// The networks that formulas call.
    pub networks: &'a Networks,
}

impl Term {
    /// Its value, given those of the `earlier` terms.
    pub(super) fn value<R: Real>(self, values: Values<'_, R>, earlier: &[R]) -> R {
        let at = |i: u32| earlier[i as usize];
        match self {
            Self::Number(number) => R::lit(number),
            Self::Name(place) => values.names[place as usize],
            Self::Output(i) => values.outputs[i as usize],
            Self::Looked(i) => values.looked[i as usize],
            Self::Negative(a) => -at(a),
            Self::Binary(Operation::Add, a, b) => at(a) + at(b),
            Self::Binary(Operation::Sub, a, b) => at(a) - at(b),
            Self::Binary(Operation::Mul, a, b) => at(a) * at(b),
            Self::Binary(Operation::Div, a, b) => at(a) / at(b),
            Self::Power(base, exponent) => power(at(base), exponent),
            Self::Call(function, operands) => function.value(operands.map(at)),
            Self::If(comparison, operands) => comparison.choose(operands.map(at)),
            Self::Network(_) => panic!("the call of a network has its arguments elsewhere"),
        }
    }

    /// Calls `see` with each operand.
    pub(super) fn operands(self, mut see: impl FnMut(u32)) {
        match self {
            Self::Number(_)
            | Self::Name(_)
            | Self::Output(_)
            | Self::Network(_)
            | Self::Looked(_) => {}
            Self::Negative(a) | Self::Power(a, _) => see(a),
            Self::Binary(_, a, b) => [a, b].into_iter().for_each(see),
            Self::Call(function, operands) => {
                operands.into_iter().take(function.arguments()).for_each(see);
            }
            Self::If(_, operands) => operands.into_iter().for_each(see),
        }
    }
}
