//! Training: policies and values by gradient descent, with the physics that the engine runs.

pub mod adam;
#[cfg(feature = "train")]
pub mod agent;
#[cfg(feature = "train")]
pub mod analytic;
pub mod backup;
pub mod checkpoint;
#[cfg(feature = "train")]
pub mod ddpg;
pub mod disturbed;
pub mod environments;
#[cfg(feature = "train")]
pub mod network;
#[cfg(feature = "train")]
pub mod physics;
pub mod record;
pub mod replay;
pub mod run;
pub mod samples;
pub mod score;
pub mod settings;
pub mod soft;
pub mod starts;
pub mod tape;
#[cfg(feature = "train")]
pub mod value;
