//! Reports as text: what they say, and that each is sound HTML.

#[path = "../page/mod.rs"]
mod page;
#[path = "../races/mod.rs"]
mod races;
#[path = "../records/mod.rs"]
mod records;
#[path = "../sweeps/mod.rs"]
mod sweeps;

mod axes;
mod certificate;
mod falsify;
mod pictures;
mod race;
mod sweep;
mod train;
