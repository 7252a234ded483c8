//! What V_check is computed with: constants, deviation bound, and what they take off the margins.

use super::constants::constants;
use super::drops_record::DropsRecord;
use super::record::{ConstantsRecord, DeviationRecord};
use super::settings::Settings;
use super::{Context, deviation, drops};
use crate::error::Result;
use crate::rollout::{Region, RolloutSpec, Tightening};

/// What the margins lose with the constants used.
pub(super) fn tightening(
    bound: &[f64],
    constants: &ConstantsRecord,
    spec: &RolloutSpec,
) -> Tightening {
    deviation::tightening(bound, constants.target.used, constants.constraint.used, spec)
}

/// Constants and deviation bound that `settings` ask for, and what they take off the margins.
///
/// # Errors
/// [`crate::Error::TooFewScenarios`] and [`crate::Error::Invalid`] before any work; those of the backend.
pub fn tightened(context: Context<'_>, settings: &Settings) -> Result<Tightened> {
    Region::new_box(&*settings.low, &*settings.high)?;
    let constants = constants(context, settings)?;
    let deviation = deviation::bound(context, settings)?;
    let drops = settings.drops.as_ref();
    let drops = drops.map(|asked| drops::bound(context, settings, asked)).transpose()?;
    let tightening = match &drops {
        Some(drops) => drops.shapes().tightening(drops.level),
        None if settings.enclosed.is_some() => Tightening::none(&settings.spec),
        None => tightening(&deviation.bound, &constants, &settings.spec),
    };
    Ok(Tightened { constants, deviation, drops, tightening })
}

/// What V_check is computed with.
#[derive(Clone, Debug)]
pub struct Tightened {
    /// Lipschitz constants.
    pub constants: ConstantsRecord,
    /// Deviation bound.
    pub deviation: DeviationRecord,
    /// The bound on margin drops, where these tighten the margins.
    pub drops: Option<DropsRecord>,
    /// What the margins lose; nothing where an enclosure says what is certified.
    pub tightening: Tightening,
}
