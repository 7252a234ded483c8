//! The race study: two drones and one gate; whole races of many controllers, judged and compared.

pub mod barrier;
pub mod bench;
pub(crate) mod command;
pub mod controller;
pub mod cost;
pub(crate) mod defaults;
pub mod flight;
mod folder;
pub mod judge;
pub mod log;
pub mod metrics;
mod page;
mod picture;
pub mod record;
pub mod run;
pub mod settings;
pub mod statistics;
pub mod summary;
pub mod sweep;
mod sweep_page;
pub mod system;
#[cfg(test)]
mod tests;
mod weights;

pub use barrier::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
pub use cost::{
    CenterlineCost, Fence, LaneCost, QuadraticCost, RACE_CONTEXT, RaceCost, RaceReference,
    RecoveryCost, Safety, SafetyCone,
};
pub use page::race_html;
pub use sweep_page::sweep_html;
pub use system::{Cone, DroneRace};
