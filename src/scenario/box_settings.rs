//! What a certificate is asked about the whole box.

use crate::error::{Error, Result};

/// What is asked about the whole box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxSettings {
    /// Largest risk that a start of the box may fail with; where there is none the risk is stated and
    /// nothing is asked for.
    pub risk: Option<f64>,
    /// One minus the confidence of the interval of that risk.
    pub beta: f64,
}

impl BoxSettings {
    /// Refuses a risk or a beta that is not strictly between 0 and 1.
    pub(crate) fn check(&self) -> Result<()> {
        let asked = self.risk.map(|risk| ("global.box_risk", risk));
        for (key, value) in asked.into_iter().chain([("global.beta", self.beta)]) {
            if !(value > 0.0 && value < 1.0) {
                let problem = format!("{value} is not strictly between 0 and 1");
                return Err(Error::invalid(key, problem));
            }
        }
        Ok(())
    }
}
