//! Tests of the native CPU backend against scalar loops, the f64 reference and itself.

mod finite;
mod fixture;
mod kernels;
mod oracle;
mod same_bits;
mod tapes;
mod vectors;
