//! Pairs whose nominal start is certified and whose perturbed one fails.

use serde::{Deserialize, Serialize};

use super::worst::Worst;
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::rollout::{
    DeviationTask, PairControl, Pairs, Region, RolloutSpec, Starts, Tightening, replay,
};
use crate::scenario::criterion::Criterion;
use crate::scenario::settings::Settings;
use crate::scenario::{Context, purpose};

/// A pair of which the nominal start is certified and the perturbed one fails.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailingPair {
    /// Its index in the conditional sample.
    pub index: u64,
    /// The nominal start.
    #[serde(with = "crate::files::number")]
    pub nominal: Vec<f32>,
    /// The perturbed start and what drives it.
    pub perturbed: Replayed,
    /// Measure of the perturbed rollout under these controls: of f64, rounded to f32.
    #[serde(with = "crate::files::number")]
    pub measure: f32,
}

/// A start under controls that are given step by step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replayed {
    /// The start.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// The controls, `[T, controls]`.
    #[serde(with = "crate::files::number")]
    pub controls: Vec<Vec<f32>>,
}

impl Replayed {
    /// The reach-avoid measure in f64.
    pub fn measure(&self, model: &Model, spec: &RolloutSpec) -> f64 {
        let mut states = vec![self.x.iter().copied().map(f64::from).collect::<Vec<f64>>()];
        for (step, controls) in (0..spec.horizon).zip(&self.controls) {
            let controls: Vec<f64> = controls.iter().copied().map(f64::from).collect();
            let x = &states[(step * model.points) as usize];
            states.extend(model.parts(x, &controls, step));
        }
        replay::fold_looks(model, &states, spec, &Tightening::none(spec))
    }
}

/// The worst failing pairs of the conditional sample whose nominal start has `V_check > 0`; those that
/// do not fail in f64 under the listed controls are left out.
///
/// # Errors
/// Those of the backend and of the watch.
pub(in crate::scenario) fn failing_pairs(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Vec<FailingPair>> {
    let tightening = criterion.tightening(&settings.spec);
    let task = task(settings, &tightening)?;
    context.watch.begin("failing pairs", settings.global.draws);
    let mut worst = Worst::default();
    context.program.deviation(&task, &mut |first, pairs| {
        let enclosed = criterion.enclosed(context, &task, first, pairs, band)?;
        for (place, pair) in pairs.iter().enumerate() {
            if enclosed.as_ref().map_or(pair.nominal > 0.0, |all| all[place]) {
                worst.add(pair.perturbed, first + place as u64);
            }
        }
        context.watch.advance(pairs.len() as u64)
    })?;
    let pairs = worst.list().iter().map(|&(_, index)| pair(context.plant(), &task, index));
    let mut pairs: Vec<FailingPair> = pairs.filter(|pair| pair.measure <= 0.0).collect();
    pairs.sort_by(|a, b| a.measure.total_cmp(&b.measure).then(a.index.cmp(&b.index)));
    Ok(pairs)
}

/// The pairs of the conditional sample.
fn task<'a>(settings: &Settings, tightening: &'a Tightening) -> Result<DeviationTask<'a>> {
    let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
    let [nominal, perturbation] = purposes.map(|purpose| settings.stream(purpose, 0));
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    Ok(DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: nominal },
            radius: settings.deviation.radius,
            stream: perturbation,
        },
        range: 0..settings.global.draws,
        spec: settings.spec,
        tightening,
        control: settings.deviation.control,
    })
}

/// Pair `index` of the task, with the controls that drive its perturbed rollout in f64.
fn pair(plant: &Plant, task: &DeviationTask<'_>, index: u64) -> FailingPair {
    failing_pair(plant, task.pairs.pair(index), &task.spec, task.control, index)
}

/// A pair of a nominal and a perturbed start, with the controls that drive the latter in f64.
pub(in crate::scenario) fn failing_pair(
    plant: &Plant,
    [nominal, perturbed]: [Vec<f32>; 2],
    spec: &RolloutSpec,
    control: PairControl,
    index: u64,
) -> FailingPair {
    let driver = match control {
        PairControl::Replay => &nominal,
        PairControl::ClosedLoop => &perturbed,
    };
    let states = replay::states::<f64>(plant, driver, spec.horizon);
    let control = |(step, x): (u32, &Vec<f64>)| {
        plant.control(x, step).into_iter().map(|control| control as f32).collect()
    };
    let controls = (0..spec.horizon).zip(&states).map(control).collect();
    let perturbed = Replayed { x: perturbed, controls };
    // Rounding to f32 keeps the sign.
    let measure = perturbed.measure(&plant.model, spec) as f32;
    FailingPair { index, nominal, perturbed, measure }
}
