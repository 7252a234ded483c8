//! Certificates: what scenarios, drawn and rolled out, allow one to claim.

pub mod record;
pub mod settings;
