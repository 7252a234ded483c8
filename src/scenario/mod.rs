//! Certificates: what scenarios, drawn and rolled out, allow one to claim.

mod attempt;
pub mod bound;
pub mod boundary;
mod budget;
mod certify;
mod claim;
mod claims;
mod compare;
mod constants;
mod coordinates;
mod derived;
pub mod deviation;
pub mod evidence;
mod finding;
pub(crate) mod fit;
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
mod origin;
pub mod purpose;
pub mod record;
pub mod sampling;
mod sequential;
pub mod sequential_record;
pub mod settings;
mod stored;
pub(crate) mod tail;
pub mod tier;
mod tightened;
mod verify;

pub use attempt::{AttemptRecord, attempt_share};
pub use certify::{certify, check_settings};
pub use finding::{CheckReport, Figure, Finding};
pub use key_source::Keys;
#[cfg(feature = "cli")]
pub(crate) use origin::provenance;
pub use origin::{Hashes, hashes};
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
