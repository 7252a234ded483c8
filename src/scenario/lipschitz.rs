//! stub
#![allow(missing_docs)]
use crate::system::System;
pub struct C {
    pub constant: f64,
}
pub struct M {
    pub target: C,
    pub constraint: C,
}
pub struct S2 {
    pub target: f64,
    pub constraint: f64,
}
pub fn margins<S: System<NX, NU>, const NX: usize, const NU: usize>(
    _s: &S,
    _l: [f32; NX],
    _h: [f32; NX],
    _v: [bool; NX],
) -> M {
    M {
        target: C { constant: 14.142 },
        constraint: C { constant: 14.422 },
    }
}
pub fn sampled<S: System<NX, NU>, const NX: usize, const NU: usize>(
    _s: &S,
    _l: [f32; NX],
    _h: [f32; NX],
    _v: [bool; NX],
    _n: u64,
) -> S2 {
    S2 {
        target: 14.,
        constraint: 14.,
    }
}
