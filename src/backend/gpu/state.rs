//! Where the calls of an adapter run now.

use std::sync::Arc;

use super::attempt::Limit;
use super::opened::Opened;

/// Where the calls of an adapter run now.
pub(super) struct State {
    pub(super) opened: Arc<Opened>,
    /// What a plan may ask of it.
    pub(super) limit: Limit,
    /// Whether it was opened again.
    pub(super) reopened: bool,
    /// Whether everything goes to the CPU from now on.
    pub(super) on_cpu: bool,
    /// Whether results came from the adapter.
    pub(super) served: bool,
}

impl State {
    pub(super) fn new(opened: Opened) -> Self {
        let (reopened, on_cpu, served) = (false, false, false);
        Self { opened: Arc::new(opened), limit: Limit::default(), reopened, on_cpu, served }
    }

    /// The device and what is kept on it.
    pub(super) fn opened(&self) -> Arc<Opened> {
        Arc::clone(&self.opened)
    }
}
