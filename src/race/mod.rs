//! The race study: two drones and one gate; whole races of many controllers, judged and compared.

#[cfg(feature = "cli")]
pub mod barrier;
#[cfg(feature = "cli")]
pub mod bench;
#[cfg(feature = "cli")]
pub(crate) mod command;
#[cfg(feature = "cli")]
pub mod controller;
pub mod cost;
#[cfg(feature = "cli")]
pub(crate) mod defaults;
#[cfg(feature = "cli")]
mod difference;
#[cfg(feature = "cli")]
pub mod flight;
#[cfg(feature = "cli")]
mod folder;
#[cfg(feature = "cli")]
pub mod judge;
#[cfg(feature = "cli")]
pub mod log;
#[cfg(feature = "cli")]
pub mod metrics;
#[cfg(feature = "cli")]
mod page;
#[cfg(feature = "cli")]
mod picture;
#[cfg(feature = "cli")]
pub mod record;
#[cfg(feature = "cli")]
pub mod run;
#[cfg(feature = "cli")]
pub mod settings;
#[cfg(feature = "cli")]
pub mod statistics;
#[cfg(feature = "cli")]
pub mod summary;
#[cfg(feature = "cli")]
pub mod sweep;
#[cfg(feature = "cli")]
mod sweep_page;
pub mod system;
#[cfg(feature = "cli")]
#[cfg(test)]
mod tests;
#[cfg(feature = "cli")]
pub mod timing;
#[cfg(feature = "cli")]
mod weights;

#[cfg(feature = "cli")]
pub use barrier::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
pub use cost::{
    CenterlineCost, Fence, LaneCost, QuadraticCost, RACE_CONTEXT, RaceCost, RaceReference,
    RecoveryCost, Safety, SafetyCone,
};
#[cfg(feature = "cli")]
pub use page::race_html;
#[cfg(feature = "cli")]
pub use sweep_page::sweep_html;
pub use system::{Cone, DroneRace};
