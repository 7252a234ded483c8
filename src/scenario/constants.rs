//! The Lipschitz constants of a certificate: computed, sampled, and used as its settings ask.

use super::lipschitz::{self, MarginBox};
use super::record::{ConstantRecord, ConstantsRecord};
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::model::Model;

/// Points whose gradients are sampled beside each computed constant.
const GRADIENT_SAMPLES: u32 = 4096;
/// How much wider a box is tried to see whether a constant depends on it.
const WIDER: f32 = 10.0;

/// The Lipschitz constants, computed, sampled, and used as `settings` ask.
pub(super) fn constants(model: &Model, settings: &Settings) -> Result<ConstantsRecord> {
    let all = vec![true; model.states.len()];
    let horizon = settings.spec.horizon;
    let region = MarginBox { low: &settings.low, high: &settings.high, varies: &all, horizon };
    let inside = lipschitz::margins(model, region);
    let wider = |side: &[f32], sign: f32| -> Vec<f32> {
        let widths = settings.low.iter().zip(&settings.high).map(|(low, high)| high - low);
        side.iter().zip(widths).map(|(side, width)| side + sign * WIDER * width).collect()
    };
    let (low, high) = (wider(&settings.low, -1.0), wider(&settings.high, 1.0));
    let outside = lipschitz::margins(model, MarginBox { low: &low, high: &high, ..region });
    let sampled = lipschitz::sampled(model, region, GRADIENT_SAMPLES, settings.seed);
    let one = |name: &str, given: Option<f64>, computed: f64, beyond: f64, sampled: f64| {
        let used = given.unwrap_or(computed);
        // Margin drops need no constant: one that cannot be shown is none.
        if settings.drops.is_none() && !(used.is_finite() && used >= 0.0) {
            let problem = format!(
                "no finite Lipschitz constant of the {name} margin over the box (computed \
                 {computed}); give a smaller box or the constant itself"
            );
            return Err(Error::invalid(format!("constants.{name}"), problem));
        }
        let source = match given {
            Some(_) => "given",
            None if beyond <= computed * (1.0 + 1e-9) => {
                "computed: gradient bound over the box, the same on a box 21 times as wide"
            }
            None => "computed: gradient bound over the box, not valid beyond it",
        };
        Ok(ConstantRecord { used, source: source.to_owned(), computed, sampled })
    };
    let given = settings.constants;
    Ok(ConstantsRecord {
        target: one(
            "target",
            given.target,
            inside.target.constant,
            outside.target.constant,
            sampled.target,
        )?,
        constraint: one(
            "constraint",
            given.constraint,
            inside.constraint.constant,
            outside.constraint.constant,
            sampled.constraint,
        )?,
    })
}
