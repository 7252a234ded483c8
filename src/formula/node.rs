//! One operation of a graph, and its value in any scalar.

use crate::real::Real;

/// One operation of a graph; operands are indices of earlier nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// The input of that number.
    Input(u32),
    /// A literal, as the bits of its f32.
    Literal(u32),
    /// Sum.
    Add(u32, u32),
    /// Difference.
    Sub(u32, u32),
    /// Product.
    Mul(u32, u32),
    /// Quotient.
    Div(u32, u32),
    /// Negation.
    Neg(u32),
    /// Absolute value.
    Abs(u32),
    /// Square root.
    Sqrt(u32),
    /// Floor.
    Floor(u32),
    /// 1, -1 or 0.
    Sign(u32),
    /// The smaller of two.
    Min(u32, u32),
    /// The larger of two.
    Max(u32, u32),
    /// A number within a lower and an upper bound, in this order.
    Clamp(u32, u32, u32),
    /// `if a < b { yes } else { no }`, in this order; NaN where `a` or `b` is.
    IfLt(u32, u32, u32, u32),
    /// The same, `no` where `a` or `b` is NaN.
    SelectLt(u32, u32, u32, u32),
    /// Euclidean length.
    Hypot(u32, u32),
    /// The angle of the point whose second coordinate comes first.
    Atan2(u32, u32),
    /// A whole power.
    Powi(u32, i32),
    /// A constant power, as the bits of its f32.
    Powf(u32, u32),
    /// An elementary function.
    Apply(Function, u32),
    /// Of the network call of that number ([`super::Graph::calls`]) the output of that number.
    Said(u32, u32),
}

/// An elementary function of one number, as [`Real`] has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Function {
    /// [`Real::sin`].
    Sin,
    /// [`Real::cos`].
    Cos,
    /// [`Real::tan`].
    Tan,
    /// [`Real::asin`].
    Asin,
    /// [`Real::acos`].
    Acos,
    /// [`Real::atan`].
    Atan,
    /// [`Real::wrap`].
    Wrap,
    /// [`Real::exp`].
    Exp,
    /// [`Real::ln`].
    Ln,
    /// [`Real::tanh`].
    Tanh,
    /// [`Real::sigmoid`].
    Sigmoid,
    /// The sine of [`Real::principal_sin_cos`].
    PrincipalSin,
    /// Its cosine.
    PrincipalCos,
    /// [`Real::exp_negative`].
    ExpNegative,
    /// [`Real::ln_unit`], the one of which instruction sets agree only within its range, `[2^-24, 1]`.
    LnUnit,
}

impl Function {
    /// All of them.
    pub const ALL: [Self; 15] = [
        Self::Sin,
        Self::Cos,
        Self::Tan,
        Self::Asin,
        Self::Acos,
        Self::Atan,
        Self::Wrap,
        Self::Exp,
        Self::Ln,
        Self::Tanh,
        Self::Sigmoid,
        Self::PrincipalSin,
        Self::PrincipalCos,
        Self::ExpNegative,
        Self::LnUnit,
    ];

    /// Its value at `x`.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        match self {
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Wrap => x.wrap(),
            Self::Exp => x.exp(),
            Self::Ln => x.ln(),
            Self::Tanh => x.tanh(),
            Self::Sigmoid => x.sigmoid(),
            Self::PrincipalSin => x.principal_sin_cos()[0],
            Self::PrincipalCos => x.principal_sin_cos()[1],
            Self::ExpNegative => x.exp_negative(),
            Self::LnUnit => x.ln_unit(),
        }
    }
}

impl Node {
    /// Its value for `inputs`, given the `values` of the earlier nodes.
    ///
    /// # Panics
    /// For the output of a network, which the graph has the call of.
    #[inline(always)]
    pub fn value<R: Real>(self, inputs: &[R], values: &[R]) -> R {
        let at = |i: u32| values[i as usize];
        match self {
            Self::Input(i) => inputs[i as usize],
            Self::Literal(bits) => R::lit(f32::from_bits(bits)),
            Self::Add(a, b) => at(a) + at(b),
            Self::Sub(a, b) => at(a) - at(b),
            Self::Mul(a, b) => at(a) * at(b),
            Self::Div(a, b) => at(a) / at(b),
            Self::Neg(a) => -at(a),
            Self::Abs(a) => at(a).abs(),
            Self::Sqrt(a) => at(a).sqrt(),
            Self::Floor(a) => at(a).floor(),
            Self::Sign(a) => at(a).sign(),
            Self::Min(a, b) => at(a).min(at(b)),
            Self::Max(a, b) => at(a).max(at(b)),
            Self::Clamp(a, low, high) => at(a).clamp(at(low), at(high)),
            Self::IfLt(a, b, yes, no) => at(a).if_lt(at(b), at(yes), at(no)),
            Self::SelectLt(a, b, yes, no) => at(a).select_lt(at(b), at(yes), at(no)),
            Self::Hypot(a, b) => at(a).hypot(at(b)),
            Self::Atan2(a, b) => at(a).atan2(at(b)),
            Self::Powi(a, exponent) => at(a).powi(exponent),
            Self::Powf(a, bits) => at(a).powf(f32::from_bits(bits)),
            Self::Apply(function, a) => function.apply(at(a)),
            Self::Said(..) => panic!("outputs of networks come from the calls of the graph"),
        }
    }

    /// Calls `see` with each operand; the arguments of a network are those of its call.
    pub(super) fn operands(self, mut see: impl FnMut(u32)) {
        self.renumbered(|operand| {
            see(operand);
            operand
        });
    }

    /// The node with its operands replaced.
    pub(super) fn renumbered(self, mut new: impl FnMut(u32) -> u32) -> Self {
        match self {
            Self::Input(_) | Self::Literal(_) | Self::Said(..) => self,
            Self::Add(a, b) => Self::Add(new(a), new(b)),
            Self::Sub(a, b) => Self::Sub(new(a), new(b)),
            Self::Mul(a, b) => Self::Mul(new(a), new(b)),
            Self::Div(a, b) => Self::Div(new(a), new(b)),
            Self::Neg(a) => Self::Neg(new(a)),
            Self::Abs(a) => Self::Abs(new(a)),
            Self::Sqrt(a) => Self::Sqrt(new(a)),
            Self::Floor(a) => Self::Floor(new(a)),
            Self::Sign(a) => Self::Sign(new(a)),
            Self::Min(a, b) => Self::Min(new(a), new(b)),
            Self::Max(a, b) => Self::Max(new(a), new(b)),
            Self::Clamp(a, low, high) => Self::Clamp(new(a), new(low), new(high)),
            Self::IfLt(a, b, yes, no) => Self::IfLt(new(a), new(b), new(yes), new(no)),
            Self::SelectLt(a, b, yes, no) => Self::SelectLt(new(a), new(b), new(yes), new(no)),
            Self::Hypot(a, b) => Self::Hypot(new(a), new(b)),
            Self::Atan2(a, b) => Self::Atan2(new(a), new(b)),
            Self::Powi(a, exponent) => Self::Powi(new(a), exponent),
            Self::Powf(a, bits) => Self::Powf(new(a), bits),
            Self::Apply(function, a) => Self::Apply(function, new(a)),
        }
    }
}
