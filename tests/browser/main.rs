//! Reports in headless Chromium: legible at every width in both schemes.

#[path = "../chromium/mod.rs"]
mod chromium;
#[path = "../races/mod.rs"]
mod races;
#[path = "../records/mod.rs"]
mod records;
#[path = "../sweeps/mod.rs"]
mod sweeps;

mod certificate;
mod race;
mod sweep;
