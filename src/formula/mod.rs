//! Formulas as data: graphs recorded from Rust or text, replayed over any scalar, printed as WGSL.

mod call;
mod chain;
mod expand;
mod node;
mod recorder;
#[cfg(test)]
mod tests;
pub mod text;
pub mod wgsl;

pub use call::{Call, Scalar};
pub(crate) use chain::{Ask, Chain, Link, Place};
pub use node::{Function, Node};
pub use recorder::{Expr, Graph, record, record_with};
