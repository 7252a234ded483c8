//! From keys to numbers: an enclosure that says what is certified, as a configuration asks for it.

use super::drops::TighteningSource;
use super::section::Config;
use crate::error::{Error, Result};
use crate::rollout::PairControl;
use crate::scenario::deterministic::Kind;

impl Config {
    /// How the balls around starts are enclosed, where that decides what is certified.
    pub(super) fn enclosed(&self) -> Result<Option<Kind>> {
        let kind = match self.global.tightening {
            TighteningSource::Drops | TighteningSource::Lipschitz => return Ok(None),
            TighteningSource::Pieces => Kind::Pieces,
            TighteningSource::Tube => Kind::Tube,
        };
        if kind == Kind::Pieces && self.deviation.control == PairControl::ClosedLoop {
            let problem = "`pieces` needs replayed controls; use `tube`, or \
                           `deviation.control = \"replay\"`";
            return Err(Error::invalid("global.tightening", problem));
        }
        Ok(Some(kind))
    }
}
