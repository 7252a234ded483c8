//! stub
#![allow(missing_docs)]
use crate::system::System;
pub fn state_matrix<S: System<NX, NU>, const NX: usize, const NU: usize>(
    _s: &S,
    _l: [f32; NX],
    _h: [f32; NX],
) -> Option<nalgebra::DMatrix<f64>> {
    None
}
pub fn exact_deviation(_a: &nalgebra::DMatrix<f64>, _r: f64, _h: u32) -> Vec<f64> {
    vec![]
}
