//! Formulas as data: graphs recorded from Rust or text, replayed over any scalar, printed as WGSL.

mod record;
pub mod text;
pub mod wgsl;

pub use record::{Expr, Graph, Node, record, record_with};
