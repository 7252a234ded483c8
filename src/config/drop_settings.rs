//! From keys to numbers: margin drops as a configuration asks for them.

use super::drops::{CalibrationSection, Count, DropsSection, TighteningSource};
use super::section::{Config, Profile};
use crate::error::Result;
use crate::scenario::attempt_share;
use crate::scenario::drops_settings::{ConditionalRisk, DropSettings, SampleSettings};

/// The conditional risk that asks for none.
const NO_RISK: f64 = 1.0;

impl Config {
    /// Margin drops, where these tighten the margins.
    pub(super) fn drop_settings(&self) -> Result<Option<DropSettings>> {
        if self.global.tightening != TighteningSource::Drops {
            return Ok(None);
        }
        // Counts that nobody gave follow from the beta that the attempt books.
        let share = self.attempt.map_or(1.0, attempt_share);
        let sample = |epsilon, beta, scenarios, discards| {
            let needed = SampleSettings::new(epsilon, share * beta, discards);
            let scenarios = match scenarios {
                // A claim that no count supports is left to whoever checks it.
                Count::Needed => needed.map_or(0, |sample| sample.scenarios),
                Count::Given(count) => count,
            };
            SampleSettings { epsilon, beta, scenarios, discards }
        };
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
            risk: self.conditional_risk(),
            share_draws: self.global.share_draws,
        };
        settings.check().map(|()| Some(settings))
    }

    /// The conditional risk of the certified set: asked for, or what the profile looks for.
    fn conditional_risk(&self) -> Option<ConditionalRisk> {
        match (self.global.risk, self.profile) {
            (Some(NO_RISK), _) => None,
            (Some(risk), _) => Some(ConditionalRisk::Asked(risk)),
            (None, Profile::Rigorous) => Some(ConditionalRisk::RIGOROUS),
            (None, Profile::Paper | Profile::Study) => None,
        }
    }
}
