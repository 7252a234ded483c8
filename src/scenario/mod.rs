//! Certificates.

pub mod linear;
pub mod lipschitz;
