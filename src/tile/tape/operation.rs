//! The operations of a tape: what each computes of its operands, in any scalar.

use crate::formula::Function;
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
            Kind::Pair(f) => f.of(a, b, c),
            Kind::Whole(f) => f.of(a),
            Kind::Clamp => a.clamp(b, c),
            Kind::Select => a.if_lt(b, c, d),
            Kind::SelectLt => a.select_lt(b, c, d),
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
    /// Two functions, one after the other, of three.
    Pair(Pair),
    /// A function of one operand that is a formula of its own.
    Whole(Whole),
    /// A number within a lower and an upper bound, in this order.
    Clamp,
    /// `if a < b { yes } else { no }`, in this order; NaN where `a` or `b` is.
    Select,
    /// The same, `no` where `a` or `b` is NaN.
    SelectLt,
}

impl Kind {
    /// How many operands it takes.
    pub(super) fn operands(self) -> usize {
        match self {
            Self::Copy | Self::Unary(_) | Self::Whole(_) => 1,
            Self::Binary(_) => 2,
            Self::Pair(_) | Self::Clamp => 3,
            Self::Select | Self::SelectLt => 4,
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
    /// Euclidean length.
    Hypot,
    /// The angle of the point whose second coordinate comes first.
    Atan2,
}

/// Functions of one number that are formulas of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Whole {
    /// 1, -1 or 0.
    Sign,
    /// An elementary function.
    Apply(Function),
    /// A whole power.
    Powi(i32),
    /// A constant power, as the bits of its f32.
    Powf(u32),
}

impl Whole {
    /// Its value.
    #[inline(always)]
    pub(super) fn of<R: Real>(self, x: R) -> R {
        match self {
            Self::Sign => x.sign(),
            Self::Apply(function) => function.apply(x),
            Self::Powi(exponent) => x.powi(exponent),
            Self::Powf(bits) => x.powf(f32::from_bits(bits)),
        }
    }
}

/// Functions of the first two of three numbers, then of that and the third, each rounded: pairs that
/// formulas are full of, with a loop of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Pair {
    /// `a * b + c`.
    MulAdd,
    /// `a * b - c`.
    MulSub,
    /// `c - a * b`.
    MulFrom,
    /// `a * b * c`.
    MulMul,
    /// `(a + b) * c`.
    AddMul,
    /// The smaller of `a + b` and `c`.
    AddMin,
    /// `(a - b) * c`.
    SubMul,
    /// The smaller of `a - b` and `c`.
    SubMin,
    /// The smallest of three.
    MinMin,
    /// The smaller of `c` and the larger of `a` and `b`: what clips.
    Clip,
}

impl Binary {
    /// Whether the order of its operands makes no difference to the bits of a number.
    pub(super) fn commutes(self) -> bool {
        matches!(self, Self::Add | Self::Mul)
    }
}

impl Pair {
    /// The pair of `first`, whose value is on the left of `second`, if it has a loop.
    pub(super) fn with_left(first: Binary, second: Binary) -> Option<Self> {
        match (first, second) {
            (Binary::Mul, Binary::Add) => Some(Self::MulAdd),
            (Binary::Mul, Binary::Sub) => Some(Self::MulSub),
            (Binary::Mul, Binary::Mul) => Some(Self::MulMul),
            (Binary::Add, Binary::Mul) => Some(Self::AddMul),
            (Binary::Add, Binary::Min) => Some(Self::AddMin),
            (Binary::Sub, Binary::Mul) => Some(Self::SubMul),
            (Binary::Sub, Binary::Min) => Some(Self::SubMin),
            (Binary::Min, Binary::Min) => Some(Self::MinMin),
            _ => None,
        }
    }

    /// The pair of `first`, whose value is on the right of `second`, if it has a loop.
    pub(super) fn with_right(first: Binary, second: Binary) -> Option<Self> {
        match (first, second) {
            (Binary::Mul, Binary::Sub) => Some(Self::MulFrom),
            (Binary::Max, Binary::Min) => Some(Self::Clip),
            (_, second) if second.commutes() => Self::with_left(first, second),
            _ => None,
        }
    }

    /// Its value.
    #[inline(always)]
    pub(super) fn of<R: Real>(self, a: R, b: R, c: R) -> R {
        match self {
            Self::MulAdd => a * b + c,
            Self::MulSub => a * b - c,
            Self::MulFrom => c - a * b,
            Self::MulMul => a * b * c,
            Self::AddMul => (a + b) * c,
            Self::AddMin => (a + b).min(c),
            Self::SubMul => (a - b) * c,
            Self::SubMin => (a - b).min(c),
            Self::MinMin => a.min(b).min(c),
            Self::Clip => c.min(a.max(b)),
        }
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
            Self::Hypot => a.hypot(b),
            Self::Atan2 => a.atan2(b),
        }
    }
}
