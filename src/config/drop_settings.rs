//! From keys to numbers: margin drops as a configuration asks for them.

use super::drops::{CalibrationSection, Count, DropsSection, TighteningSource, no_risk};
use super::section::Config;
use crate::error::Result;
use crate::scenario::drops_settings::{DropSettings, SampleSettings};

impl Config {
    /// Margin drops, where these tighten the margins.
    pub(super) fn drop_settings(&self) -> Result<Option<DropSettings>> {
        if self.global.tightening != TighteningSource::Drops {
            return Ok(None);
        }
        let DropsSection { pilot, epsilon, beta, scenarios, discards } = self.drops;
        let calibration = &self.calibration;
        let calibrated = (calibration.epsilon < 1.0).then(|| {
            let CalibrationSection { epsilon, beta, scenarios, discards } = *calibration;
            sample(epsilon, beta, scenarios, discards)
        });
        let settings = DropSettings {
            pilot,
            sample: sample(epsilon, beta, scenarios, discards),
            calibration: calibrated,
            risk: (self.global.risk < no_risk()).then_some(self.global.risk),
            share_draws: self.global.share_draws,
        };
        settings.check().map(|()| Some(settings))
    }
}

/// A claim with its pairs; a claim that no count supports is left to whoever checks it.
fn sample(epsilon: f64, beta: f64, scenarios: Count, discards: u64) -> SampleSettings {
    let needed =
        || SampleSettings::new(epsilon, beta, discards).map_or(0, |sample| sample.scenarios);
    let scenarios = match scenarios {
        Count::Needed => needed(),
        Count::Given(count) => count,
    };
    SampleSettings { epsilon, beta, scenarios, discards }
}
