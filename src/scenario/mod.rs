//! Certificates: what scenarios, drawn and rolled out, allow one to claim.

mod answer;
mod assumptions;
mod attempt;
pub mod bound;
pub mod boundary;
mod box_record;
mod box_settings;
mod budget;
mod calibration;
mod certify;
mod claim;
mod claims;
mod compare;
mod constant_record;
mod constants;
mod coordinates;
pub mod counterexamples;
pub mod criterion;
mod derived;
pub mod deterministic;
mod deterministic_record;
mod deterministic_set;
pub mod deterministic_settings;
pub mod deviation;
pub mod drawn_record;
pub mod drops;
pub mod drops_record;
pub mod drops_settings;
#[cfg(feature = "cli")]
mod effort;
mod empty;
mod enclosed_record;
pub mod enclosure;
pub mod evidence;
pub mod falsify;
mod finding;
pub(crate) mod fit;
mod fresh;
mod fresh_drops;
pub mod global;
pub mod growth;
pub mod growth_batch;
pub mod growth_plan;
mod growth_set;
mod growth_upward;
mod key_source;
mod keys;
pub mod ledger;
pub(crate) mod limits;
pub mod linear;
pub mod lipschitz;
mod margins;
mod membership;
mod origin;
mod pairs_f64;
mod picture;
mod probe;
pub mod purpose;
pub mod record;
mod refuted;
pub mod sampling;
pub mod sequence;
mod sequential;
pub mod sequential_record;
pub(crate) mod sets;
pub mod settings;
mod shares;
mod side;
mod spacing;
mod stored;
pub(crate) mod tail;
pub mod tier;
mod tightened;
mod verdict;
mod verify;
mod visited;
mod walk;
mod whole_box;

pub use answer::Beside;
pub use attempt::{AttemptRecord, attempt_share};
pub use box_record::BoxRecord;
pub use box_settings::BoxSettings;
pub use certify::{certify, check_settings};
#[cfg(feature = "cli")]
pub(crate) use effort::most_rollouts_of_check;
pub use finding::{CheckReport, Figure, Finding};
pub use key_source::Keys;
pub use origin::{Hashes, hashes};
#[cfg(feature = "cli")]
pub(crate) use origin::{provenance, system_record};
pub use picture::bodies_and_shapes;
#[cfg(feature = "cli")]
pub(crate) use spacing::least_perturbation;
pub use tightened::{Tightened, tightened};
pub use verify::{QueryRow, check, query};

use crate::backend::Program;
use crate::error::Result;
use crate::model::{Model, Plant};

/// Follows the work: shows progress, and stops it.
pub trait Watch {
    /// A stage of `total` rollouts begins.
    fn begin(&self, stage: &str, total: u64);
    /// `count` more rollouts of the stage are done.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`] to stop the work.
    fn advance(&self, count: u64) -> Result<()>;
}

/// A watch that does nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watch for Unwatched {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _count: u64) -> Result<()> {
        Ok(())
    }
}

/// What every stage works with: what runs, and who watches.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// What runs.
    pub program: &'a Program<'a>,
    /// Who watches.
    pub watch: &'a dyn Watch,
}

impl<'a> Context<'a> {
    /// What is rolled out.
    pub fn plant(&self) -> &'a Plant {
        self.program.plant()
    }

    /// Its model.
    pub fn model(&self) -> &'a Model {
        &self.program.plant().model
    }
}
