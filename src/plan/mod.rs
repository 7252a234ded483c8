//! Plans in closed loop: a model steered step by step by plans that are improved as it moves.

mod closed_loop;
mod judged;
mod lost;
mod notes;
mod origin;
mod plane;
pub mod record;
pub mod settings;
mod summary;
mod table;

pub use closed_loop::{ClosedLoop, FirstPlans, Flown, Stopped, Trajectory, starts};
pub use judged::Judged;
pub use origin::costs_sha256;
pub use plane::Plane;
pub use record::PlanRecord;
pub use settings::PlanSettings;
pub use summary::Setting;
pub use table::{steps_table, trajectories};
