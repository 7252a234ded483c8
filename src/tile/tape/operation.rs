//! The operations of a tape: what each computes of its operands, in any scalar.

use crate::real::Real;

/// Most operands of an operation.
pub(super) const OPERANDS: usize = 4;

/// One operation: what it computes, and of what.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Operation<T> {
    /// What it computes.
    pub(super) kind: Kind,
    /// Its operands, as many as [`Kind::operands`] says; the others repeat the last.
    operands: [T; OPERANDS],
}

impl<T: Copy> Operation<T> {
    /// The operation `kind` of `operands`.
    ///
    /// # Panics
    /// If there are not as many as it takes.
    pub(super) fn new(kind: Kind, operands: &[T]) -> Self {
        assert_eq!(operands.len(), kind.operands(), "operands of {kind:?}");
        let last = operands.len() - 1;
        Self { kind, operands: std::array::from_fn(|i| operands[i.min(last)]) }
    }

    /// Its operands.
    pub(super) fn operands(&self) -> &[T] {
        &self.operands[..self.kind.operands()]
    }

    /// All places for operands.
    #[inline(always)]
    pub(super) fn places(&self) -> [T; OPERANDS] {
        self.operands
    }

    /// The same of operands that are written in another way.
    pub(super) fn map<U: Copy>(&self, new: impl FnMut(T) -> U) -> Operation<U> {
        Operation { kind: self.kind, operands: self.operands.map(new) }
    }
}

impl<R: Real> Operation<R> {
    /// Its value, where the operands are numbers.
    pub(super) fn value(&self) -> R {
        let [a, b, c, d] = self.operands;
        match self.kind {
            Kind::Copy => a,
            Kind::Unary(f) => f.of(a),
            Kind::Binary(f) => f.of(a, b),
            Kind::Pair(first, then) => then.of(first.of(a, b), c),
            Kind::Select => a.if_lt(b, c, d),
        }
    }
}

/// What an operation computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// The operand.
    Copy,
    /// A function of one operand.
    Unary(Unary),
    /// A function of two.
    Binary(Binary),
    /// A function of the first two, then one of that and the third, each rounded.
    Pair(Binary, Then),
    /// `if a < b { yes } else { no }`, in this order.
    Select,
}

impl Kind {
    /// How many operands it takes.
    pub(super) fn operands(self) -> usize {
        match self {
            Self::Copy | Self::Unary(_) => 1,
            Self::Binary(_) => 2,
            Self::Pair(..) => 3,
            Self::Select => 4,
        }
    }
}

/// Functions of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Unary {
    /// Negation.
    Neg,
    /// Absolute value.
    Abs,
    /// Square root.
    Sqrt,
    /// Floor.
    Floor,
}

/// Functions of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Binary {
    /// Sum.
    Add,
    /// Difference.
    Sub,
    /// Product.
    Mul,
    /// Quotient.
    Div,
    /// The smaller.
    Min,
    /// The larger.
    Max,
}

/// Which of two numbers an operation takes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Side {
    /// The one just computed.
    Left,
    /// The other one.
    Right,
}

/// The second function of a pair, and on which side of it the first one's value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Then {
    /// Sum.
    Add,
    /// Value less third operand.
    Sub,
    /// Third operand less value.
    From,
    /// Product.
    Mul,
    /// The smaller of value and third operand.
    Min,
    /// The smaller of third operand and value.
    MinOf,
    /// The larger of value and third operand.
    Max,
    /// The larger of third operand and value.
    MaxOf,
}

impl Binary {
    /// Whether the order of its operands makes no difference to the bits of a number.
    pub(super) fn commutes(self) -> bool {
        matches!(self, Self::Add | Self::Mul)
    }

    /// The function as the second of a pair, if pairs are made of it: a quotient takes longer
    /// than the loads that a pair saves.
    pub(super) fn then(self, side: Side) -> Option<Then> {
        Some(match (self, side) {
            (Self::Add, _) => Then::Add,
            (Self::Mul, _) => Then::Mul,
            (Self::Sub, Side::Left) => Then::Sub,
            (Self::Sub, Side::Right) => Then::From,
            (Self::Min, Side::Left) => Then::Min,
            (Self::Min, Side::Right) => Then::MinOf,
            (Self::Max, Side::Left) => Then::Max,
            (Self::Max, Side::Right) => Then::MaxOf,
            (Self::Div, _) => return None,
        })
    }
}

impl Unary {
    /// Its value.
    #[inline(always)]
    pub(super) fn of<R: Real>(self, x: R) -> R {
        match self {
            Self::Neg => -x,
            Self::Abs => x.abs(),
            Self::Sqrt => x.sqrt(),
            Self::Floor => x.floor(),
        }
    }
}

impl Binary {
    /// Its value.
    #[inline(always)]
    pub(super) fn of<R: Real>(self, a: R, b: R) -> R {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Min => a.min(b),
            Self::Max => a.max(b),
        }
    }
}

impl Then {
    /// Its value, of what the first function gave and the third operand.
    #[inline(always)]
    pub(super) fn of<R: Real>(self, value: R, c: R) -> R {
        match self {
            Self::Add => value + c,
            Self::Sub => value - c,
            Self::From => c - value,
            Self::Mul => value * c,
            Self::Min => value.min(c),
            Self::MinOf => c.min(value),
            Self::Max => value.max(c),
            Self::MaxOf => c.max(value),
        }
    }
}
