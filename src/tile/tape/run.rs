//! A tape run over the rows of a tile: one loop per operation.

use std::cell::Cell;

use super::operation::{Binary, Kind, Pair, Unary, Whole};
use super::place::{Place, Step};
use crate::formula::Function;
use crate::real::Vector;
use crate::real::simd::Formulas;
use crate::tile::{Block, Frame, GRANULE};

/// The operations of a tape over the first `lanes` trajectories of a frame.
pub(super) struct Run<'a> {
    /// The operations.
    pub(super) steps: &'a [Step],
    /// The rows.
    pub(super) frame: &'a mut Frame,
    /// How many trajectories.
    pub(super) lanes: usize,
}

impl Formulas for Run<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let (stride, length) = (self.frame.width() / GRANULE, self.lanes.div_ceil(GRANULE));
        let rows = Rows { blocks: self.frame.blocks(), stride, length };
        for step in self.steps {
            let (to, [a, b, c, d]) = (rows.row(step.to), step.operation.places());
            match step.operation.kind {
                Kind::Copy => copy::<V>(rows, to, a),
                Kind::Unary(f) => unary::<V>(rows, to, f, a),
                Kind::Binary(f) => binary::<V>(rows, to, f, [a, b]),
                Kind::Pair(f) => pair::<V>(rows, to, f, [a, b, c]),
                Kind::Whole(f) => whole::<V>(rows, to, f, a),
                Kind::Clamp => clamp::<V>(rows, to, [a, b, c]),
                Kind::Select => select::<V>(rows, to, [a, b, c, d]),
                Kind::SelectLt => select_lt::<V>(rows, to, [a, b, c, d]),
            }
        }
    }
}

/// All rows of a frame.
#[derive(Clone, Copy)]
struct Rows<'a> {
    blocks: &'a [Cell<Block>],
    /// Blocks of a row.
    stride: usize,
    /// Blocks of a row that are computed.
    length: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn row(self, row: usize) -> Row<'a> {
        Row(&self.blocks[row * self.stride..][..self.length])
    }
}

/// An operand inside a loop.
trait Operand: Copy {
    /// Its vector at number `at` of a block.
    fn vector<V: Vector>(self, block: usize, at: usize) -> V;
}

/// The blocks of a row.
#[derive(Clone, Copy)]
struct Row<'a>(&'a [Cell<Block>]);

impl Operand for Row<'_> {
    #[inline(always)]
    fn vector<V: Vector>(self, block: usize, at: usize) -> V {
        V::load(&self.0[block].get()[at..])
    }
}

/// The same number everywhere.
#[derive(Clone, Copy)]
struct Splat(f32);

impl Operand for Splat {
    #[inline(always)]
    fn vector<V: Vector>(self, _block: usize, _at: usize) -> V {
        V::lit(self.0)
    }
}

/// `$body` with `$name` as the operand at `$place`: compiled for rows and for numbers.
macro_rules! operand {
    ($rows:ident, $place:expr, $name:ident => $body:expr) => {
        match $place {
            Place::Row(row) => {
                let $name = $rows.row(row);
                $body
            }
            Place::Number(number) => {
                let $name = Splat(number);
                $body
            }
        }
    };
}

/// `$body` with the two operands at `$places`.
macro_rules! operands {
    ($rows:ident, $places:expr, [$a:ident, $b:ident] => $body:expr) => {
        match $places {
            [Place::Row(a), b] => {
                let $a = $rows.row(a);
                operand!($rows, b, $b => $body)
            }
            [Place::Number(a), Place::Row(b)] => {
                let ($a, $b) = (Splat(a), $rows.row(b));
                $body
            }
            [Place::Number(_), Place::Number(_)] => unreachable!("numbers are folded"),
        }
    };
}

/// `$body` with `$known` as the constant that `$f` is: which of those listed, is asked outside of
/// the loop that is in it.
macro_rules! one_of {
    ($f:expr, $kind:ident: $($name:ident)*, $known:ident => $body:expr) => {
        match $f {
            $($kind::$name => {
                let $known = $kind::$name;
                $body
            })*
        }
    };
}

#[inline(always)]
fn copy<V: Vector>(rows: Rows<'_>, to: Row<'_>, a: Place) {
    operand!(rows, a, a => each(to, |block, at| -> V { a.vector(block, at) }));
}

#[inline(always)]
fn unary<V: Vector>(rows: Rows<'_>, to: Row<'_>, f: Unary, a: Place) {
    let Place::Row(a) = a else { unreachable!("numbers are folded") };
    let a = rows.row(a);
    one_of!(f, Unary: Neg Abs Sqrt Floor, f => {
        each(to, |block, at| -> V { f.of(a.vector(block, at)) });
    });
}

#[inline(always)]
fn binary<V: Vector>(rows: Rows<'_>, to: Row<'_>, f: Binary, places: [Place; 2]) {
    operands!(rows, places, [a, b] => one_of!(f, Binary: Add Sub Mul Div Min Max Hypot Atan2, f => {
        each(to, |block, at| -> V { f.of(a.vector(block, at), b.vector(block, at)) });
    }));
}

#[inline(always)]
fn pair<V: Vector>(rows: Rows<'_>, to: Row<'_>, f: Pair, [a, b, c]: [Place; 3]) {
    operands!(rows, [a, b], [a, b] => operand!(rows, c, c => {
        one_of!(f, Pair:
            MulAdd MulSub MulFrom MulMul AddMul AddMin SubMul SubMin MinMin Clip, f => {
            each(to, |block, at| -> V {
                f.of(a.vector(block, at), b.vector(block, at), c.vector(block, at))
            });
        });
    }));
}

#[inline(always)]
fn select<V: Vector>(rows: Rows<'_>, to: Row<'_>, [a, b, yes, no]: [Place; 4]) {
    operands!(rows, [a, b], [a, b] => operand!(rows, yes, yes => operand!(rows, no, no => {
        each(to, |block, at| -> V {
            let (yes, no) = (yes.vector(block, at), no.vector(block, at));
            V::if_lt(a.vector(block, at), b.vector(block, at), yes, no)
        });
    })));
}

/// A function that is a formula of its own: which one, is asked outside of the loop.
#[inline(always)]
fn whole<V: Vector>(rows: Rows<'_>, to: Row<'_>, f: Whole, a: Place) {
    let Place::Row(a) = a else { unreachable!("numbers are folded") };
    let a = rows.row(a);
    macro_rules! applied {
        ($function:expr, $($name:ident)*) => {
            match $function {
                $(Function::$name => {
                    each(to, |block, at| -> V { Function::$name.apply(a.vector(block, at)) });
                })*
            }
        };
    }
    match f {
        Whole::Sign => each(to, |block, at| -> V { a.vector::<V>(block, at).sign() }),
        Whole::Powi(exponent) => {
            each(to, |block, at| -> V { a.vector::<V>(block, at).powi(exponent) });
        }
        Whole::Powf(bits) => {
            let exponent = f32::from_bits(bits);
            each(to, |block, at| -> V { a.vector::<V>(block, at).powf(exponent) });
        }
        Whole::Apply(function) => applied!(function, Sin Cos Tan Asin Acos Atan Wrap Exp Ln Tanh
            Sigmoid PrincipalSin PrincipalCos ExpNegative LnUnit),
    }
}

#[inline(always)]
fn clamp<V: Vector>(rows: Rows<'_>, to: Row<'_>, [a, low, high]: [Place; 3]) {
    operand!(rows, a, a => operand!(rows, low, low => operand!(rows, high, high => {
        each(to, |block, at| -> V {
            a.vector::<V>(block, at).clamp(low.vector(block, at), high.vector(block, at))
        });
    })));
}

#[inline(always)]
fn select_lt<V: Vector>(rows: Rows<'_>, to: Row<'_>, [a, b, yes, no]: [Place; 4]) {
    operands!(rows, [a, b], [a, b] => operand!(rows, yes, yes => operand!(rows, no, no => {
        each(to, |block, at| -> V {
            let (yes, no) = (yes.vector(block, at), no.vector(block, at));
            V::select_lt(a.vector(block, at), b.vector(block, at), yes, no)
        });
    })));
}

/// Writes `f` of the number of each block and of the place in it to a row.
#[inline(always)]
fn each<V: Vector>(Row(to): Row<'_>, f: impl Fn(usize, usize) -> V) {
    for (block, to) in to.iter().enumerate() {
        let mut numbers = [0.0; GRANULE];
        for at in (0..GRANULE).step_by(V::WIDTH) {
            f(block, at).store(&mut numbers[at..]);
        }
        to.set(numbers);
    }
}
