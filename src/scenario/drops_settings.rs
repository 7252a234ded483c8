//! What margin drops, the sequence of levels and the calibration of the score are asked for.

use super::bound::{required_with_failures, simple_scenarios};
use crate::error::{Error, Result};

/// Most pairs or starts of a sample: a fast GPU's work of a day.
const MOST_SAMPLES: u64 = 1_000_000_000_000;

/// The bound on margin drops, section 3 of `docs/method.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DropSettings {
    /// Pairs of the pilot that fixes the shapes.
    pub pilot: u64,
    /// The bound.
    pub sample: SampleSettings,
    /// Calibration of the score; none where it is not asked for.
    pub calibration: Option<SampleSettings>,
    /// Conditional risk e that the sequence of levels is to obtain; none where one set is reported with
    /// the risk obtained.
    pub risk: Option<ConditionalRisk>,
    /// Fresh starts that estimate the share of each set.
    pub share_draws: u64,
}

/// The conditional risk e of the certified set, strictly between 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConditionalRisk {
    /// A claim that is asked for: where it is not obtained, not all claims are.
    Asked(f64),
    /// The set of this risk where the draws show it; else one set with the risk obtained.
    LookedFor(f64),
}

impl ConditionalRisk {
    /// What the rigorous profile looks for.
    pub const RIGOROUS: Self = Self::LookedFor(0.005);

    /// The risk.
    pub fn value(self) -> f64 {
        match self {
            Self::Asked(risk) | Self::LookedFor(risk) => risk,
        }
    }

    /// The risk that is asked for.
    pub(super) fn asked(self) -> Option<f64> {
        match self {
            Self::Asked(risk) => Some(risk),
            Self::LookedFor(_) => None,
        }
    }
}

/// Pairs of a claim on the largest of a number each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleSettings {
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Pairs N.
    pub scenarios: u64,
    /// Pairs k that are discarded, the largest ones; fixed before the draw.
    pub discards: u64,
}

impl SampleSettings {
    /// The claim with as many pairs as it needs: by the simple bound without discards, by the exact
    /// binomial with.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a risk or a beta that no count supports.
    pub fn new(epsilon: f64, beta: f64, discards: u64) -> Result<Self> {
        let scenarios = match discards {
            0 => simple_scenarios(epsilon, beta, 1)?,
            _ => required_with_failures(epsilon, beta, discards)?,
        };
        Ok(Self { epsilon, beta, scenarios, discards })
    }

    /// Refuses a claim that no count supports, and fewer pairs than it needs.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key in `section`.
    pub(super) fn check(&self, section: &str) -> Result<()> {
        let named = |error: Error| match error {
            Error::Invalid { place, problem } => {
                Error::invalid(format!("{section}.{place}"), problem)
            }
            other => other,
        };
        let &Self { epsilon, beta, scenarios, discards } = self;
        let need = required_with_failures(epsilon, beta, discards).map_err(named)?;
        if scenarios < need || scenarios > MOST_SAMPLES {
            let problem = format!(
                "{scenarios} pairs of which {discards} are discarded; epsilon = {epsilon} and beta = \
                 {beta} need {need}, and at most {MOST_SAMPLES} can be drawn"
            );
            return Err(Error::invalid(format!("{section}.scenarios"), problem));
        }
        Ok(())
    }
}

impl DropSettings {
    /// The rigorous profile: risk 0.1 and beta 1e-3 of bound and calibration, conditional risk 0.005.
    ///
    /// # Errors
    /// None of these numbers has one.
    pub fn rigorous() -> Result<Self> {
        let sample = SampleSettings::new(0.1, 1e-3, 0)?;
        let calibration = Some(SampleSettings::new(0.1, 1e-3, 5)?);
        let risk = Some(ConditionalRisk::RIGOROUS);
        Ok(Self { pilot: 1000, sample, calibration, risk, share_draws: 100_000 })
    }

    /// The conditional risk, asked for or looked for.
    pub(super) fn risk_value(&self) -> Option<f64> {
        self.risk.map(ConditionalRisk::value)
    }

    /// Refuses numbers out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting as a file does.
    pub fn check(&self) -> Result<()> {
        self.sample.check("drops")?;
        self.calibration.map_or(Ok(()), |sample| sample.check("calibration"))?;
        for (key, count) in [("drops.pilot", self.pilot), ("global.share_draws", self.share_draws)]
        {
            if !(1..=MOST_SAMPLES).contains(&count) {
                let problem = format!("{count} is not within 1..={MOST_SAMPLES}");
                return Err(Error::invalid(key, problem));
            }
        }
        match self.risk_value() {
            Some(risk) if !(risk > 0.0 && risk < 1.0) => {
                let problem = format!("{risk} is not strictly between 0 and 1");
                Err(Error::invalid("global.risk", problem))
            }
            _ => Ok(()),
        }
    }
}
