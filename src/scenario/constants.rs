//! The Lipschitz constants of a certificate: computed, sampled, and used as its settings ask.

use super::Context;
use super::assumptions::GIVEN;
use super::lipschitz::{self, MarginBox};
use super::record::{ConstantRecord, ConstantsRecord, VisitedRecord};
use super::settings::{ConstantRegion, Settings};
use super::visited::visited;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::real::bound::Lipschitz;

/// Points whose gradients are sampled beside each computed constant.
const GRADIENT_SAMPLES: u32 = 4096;
/// How much wider a box is tried to see whether a constant depends on it.
const WIDER: f32 = 10.0;

/// The Lipschitz constants, computed where rollouts go, sampled, and used as `settings` ask.
pub(super) fn constants(context: Context<'_>, settings: &Settings) -> Result<ConstantsRecord> {
    let region = match settings.constants.region {
        ConstantRegion::Box => None,
        ConstantRegion::Visited => Some(visited(context, settings)?),
    };
    over(context.model(), settings, region)
}

/// What `stored` says as `settings` and the region that its pilot visited give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: &ConstantsRecord,
) -> Result<ConstantsRecord> {
    let size = model.states.len();
    let whole = |region: &&VisitedRecord| {
        let sides = region.low.iter().zip(&region.high);
        region.low.len() == size && region.high.len() == size && sides.clone().all(|(a, b)| a <= b)
    };
    let region = match settings.constants.region {
        ConstantRegion::Box => None,
        ConstantRegion::Visited => Some(stored.region.as_ref().filter(whole).ok_or_else(|| {
            let problem = "constants.region is missing, or has another size; certify again";
            Error::Refused(problem.to_owned())
        })?),
    };
    over(model, settings, region.cloned())
}

/// The constants over `region`, or the box of starts.
fn over(
    model: &Model,
    settings: &Settings,
    region: Option<VisitedRecord>,
) -> Result<ConstantsRecord> {
    let all = vec![true; model.states.len()];
    let (low, high) = match &region {
        Some(VisitedRecord { low, high, .. }) => (low, high),
        None => (&settings.low, &settings.high),
    };
    let horizon = settings.spec.horizon;
    let inner = MarginBox { low, high, varies: &all, horizon };
    let inside = lipschitz::margins(model, inner);
    let wider = |side: &[f32], sign: f32| -> Vec<f32> {
        let widths = low.iter().zip(high).map(|(low, high)| high - low);
        let moved = |(side, width): (&f32, f32)| side + sign * WIDER * width;
        side.iter().zip(widths).map(moved).map(|end| end.clamp(f32::MIN, f32::MAX)).collect()
    };
    let (low, high) = (wider(low, -1.0), wider(high, 1.0));
    let outside = lipschitz::margins(model, MarginBox { low: &low, high: &high, ..inner });
    let sampled = lipschitz::sampled(model, inner, GRADIENT_SAMPLES, settings.seed);
    let given = &settings.constants;
    let place = if region.is_some() { VISITED } else { BOX };
    let rest = settings.drops.is_none() && settings.enclosed.is_none();
    let need = if rest { Need::Finite } else { Need::None };
    let one = |name, given, inside: Lipschitz, outside: Lipschitz, sampled| {
        constant(&Found { name, place, inside, beyond: outside.constant, sampled, need }, given)
    };
    Ok(ConstantsRecord {
        target: one("target", given.target, inside.target, outside.target, sampled.target)?,
        constraint: one(
            "constraint",
            given.constraint,
            inside.constraint,
            outside.constraint,
            sampled.constraint,
        )?,
        region,
        assumed: given.assume.clone(),
    })
}

/// The box of starts in words.
const BOX: &str = "the box";
/// The hull of pilot rollouts in words.
const VISITED: &str = "the states that the pilot visited, widened";

/// What was found of a margin.
struct Found {
    /// Which margin.
    name: &'static str,
    /// Where, in words.
    place: &'static str,
    /// The bound there.
    inside: Lipschitz,
    /// The bound on a box 21 times as wide.
    beyond: f64,
    /// The largest slope of a sample.
    sampled: f64,
    /// Whether something rests on it.
    need: Need,
}

/// Whether a certificate needs a finite constant: margin drops and enclosures need none.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Need {
    Finite,
    None,
}

/// The constant of a margin as it is used; 0 is one of a margin that does not change.
fn constant(found: &Found, given: Option<f64>) -> Result<ConstantRecord> {
    let Found { name, place, inside, beyond, sampled, need } = *found;
    let computed = inside.constant;
    let used = given.unwrap_or(computed);
    if need == Need::Finite && !(used.is_finite() && used >= 0.0) {
        let problem = format!(
            "no finite Lipschitz constant of the {name} margin over {place} (computed {computed}); give a \
             smaller box or the constant itself"
        );
        return Err(Error::invalid(format!("constants.{name}"), problem));
    }
    let source = match given {
        Some(_) => GIVEN.to_owned(),
        None if beyond <= computed * (1.0 + 1e-9) => {
            format!("computed: gradient bound over {place}, the same on a box 21 times as wide")
        }
        None => format!("computed: gradient bound over {place}, not valid beyond it"),
    };
    Ok(ConstantRecord {
        used,
        source,
        computed,
        sampled,
        assumed_continuous: Some(inside.assumed_continuous),
        hulled: Some(inside.hulled),
    })
}
