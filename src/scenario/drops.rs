//! The bound on margin drops: how much less margin a perturbed rollout has than its nominal one.

use rayon::prelude::*;

use super::Context;
use super::bound::{certified_risk, required_with_failures, simple_scenarios};
use super::coordinates::{Coordinates, coordinates};
use super::drops_record::{DropsRecord, ShareRecord, WidestRecord};
use super::drops_settings::{DropSettings, SampleSettings};
use super::purpose;
use super::record::Claim;
use super::settings::Settings;
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::rollout::drops::{Shapes, drops};
use crate::rollout::replay::{Margins, PairMargins, pair_margins};
use crate::rollout::{Pairs, Purpose, Region, Starts};
use crate::rounding::{complement, confidence};

/// The least unit of a step, of the largest of its margin: a direction that dies out would leave a unit
/// near zero, which one pair could exceed many times over.
const FLOOR: f64 = 1e-2;
/// The unit of a margin that drops in no pair of the pilot: a constant one loses next to nothing, whatever
/// lambda is, and one that drops after all makes lambda large.
const NO_DROP: f64 = 1e-9;
/// Pairs whose margins are held at once.
const CHUNK: u64 = 4096;

/// Draws pilot and pairs and bounds the drops, all of them in f64: drops cancel in f32.
///
/// # Errors
/// [`crate::Error::Invalid`] for an empty box, and [`crate::Error::Interrupted`] if the watch says so.
pub(super) fn bound(
    context: Context<'_>,
    settings: &Settings,
    asked: &DropSettings,
) -> Result<DropsRecord> {
    let shapes = pilot(context, settings, asked.pilot)?;
    let purposes = [purpose::DROPS_NOMINAL, purpose::DROPS_PERTURBATION];
    let SampleSettings { scenarios, discards, .. } = asked.sample;
    let drops =
        each_pair(context, settings, "margin drops", purposes, scenarios, |index, pair| Drop {
            size: shapes.largest(pair),
            pair: index,
        })?;
    let largest = drops.iter().copied().reduce(Drop::larger);
    let widest = largest.filter(|drop| drop.size.is_finite());
    let widest = widest.map(|drop| widest_at(context, settings, &shapes, drop.pair));
    Ok(DropsRecord {
        claim: claim(context.model(), settings, asked)?,
        pilot: asked.pilot,
        level: level(drops.iter().map(|drop| drop.size), discards),
        largest: largest.map_or(f64::NEG_INFINITY, |drop| drop.size),
        widest: widest.transpose()?,
        non_finite: drops.iter().filter(|drop| drop.size == f64::INFINITY).count() as u64,
        share: ShareRecord::default(),
        by_constants: None,
        target_shape: shapes.target,
        constraint_shape: shapes.constraint,
    })
}

/// What `stored` says as its own numbers and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    asked: &DropSettings,
    stored: &DropsRecord,
) -> Result<DropsRecord> {
    Ok(DropsRecord {
        claim: claim(model, settings, asked)?,
        pilot: asked.pilot,
        share: ShareRecord::new(stored.share.inside, asked.share_draws, asked.sample.beta),
        ..stored.clone()
    })
}

/// The largest drop of a pair.
#[derive(Clone, Copy, Debug)]
struct Drop {
    size: f64,
    pair: u64,
}

impl Drop {
    /// The larger of two; of equal ones the first.
    fn larger(self, other: Self) -> Self {
        if other.size > self.size { other } else { self }
    }
}

/// The level that all of `sizes` but the `discards` largest keep below: rounded up, and never below 0,
/// since the proof ends with the nominal rollout's first violation only then.
///
/// Infinite where all are discarded.
pub fn level(sizes: impl Iterator<Item = f64>, discards: u64) -> f64 {
    let mut sizes: Vec<f64> = sizes.collect();
    sizes.sort_unstable_by(|a, b| b.total_cmp(a));
    let left = usize::try_from(discards).ok().and_then(|discards| sizes.get(discards));
    let rounded = |size: f64| if size > 0.0 { size.next_up() } else { 0.0 };
    left.map_or(f64::INFINITY, |size| rounded(*size))
}

/// The shapes that the pilot fixes: the largest drop of each margin at each step.
fn pilot(context: Context<'_>, settings: &Settings, count: u64) -> Result<Shapes> {
    let purposes = [purpose::DROPS_PILOT_NOMINAL, purpose::DROPS_PILOT_PERTURBATION];
    let all = each_pair(context, settings, "pilot of margin drops", purposes, count, |_, pair| {
        drops(pair).collect::<Vec<_>>()
    })?;
    Ok(shapes(&all, settings.spec.horizon as usize + 1))
}

/// The shapes of pairs with these drops: at each step the largest of its sample and of the points before it.
pub fn shapes(pairs: &[Vec<Margins>], steps: usize) -> Shapes {
    let largest = |margin: &dyn Fn(&Margins) -> f64| -> Vec<f64> {
        let mut largest = vec![0.0; steps];
        for drop in pairs.iter().flatten().filter(|drop| margin(drop).is_finite()) {
            let most = &mut largest[drop.moment.sample()];
            *most = margin(drop).max(*most);
        }
        largest
    };
    Shapes {
        target: with_floor(largest(&|drop| drop.target)),
        constraint: with_floor(largest(&|drop| drop.constraint)),
    }
}

/// `largest` with no step below a share of the largest of all.
fn with_floor(largest: Vec<f64>) -> Vec<f64> {
    let most = largest.iter().copied().fold(0.0, f64::max);
    let floor = if most > 0.0 { FLOOR * most } else { NO_DROP };
    largest.into_iter().map(|drop| drop.max(floor)).collect()
}

/// The pairs of two streams.
pub(super) fn pairs(settings: &Settings, purposes: [Purpose; 2]) -> Result<Pairs<'static>> {
    let [nominal, perturbation] = purposes.map(|purpose| settings.stream(purpose, 0));
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    Ok(Pairs {
        nominal: Starts::Drawn { region, stream: nominal },
        radius: settings.deviation.radius,
        stream: perturbation,
    })
}

/// What `of` says of the margins of each of `count` pairs, in order of index.
pub(super) fn each_pair<T: Send>(
    context: Context<'_>,
    settings: &Settings,
    stage: &str,
    purposes: [Purpose; 2],
    count: u64,
    of: impl Fn(u64, &PairMargins) -> T + Sync,
) -> Result<Vec<T>> {
    context.watch.begin(stage, count);
    let (pairs, plant) = (pairs(settings, purposes)?, context.plant());
    let mut all = Vec::new();
    for first in (0..count).step_by(CHUNK as usize) {
        let chunk = (first..count.min(first + CHUNK)).into_par_iter();
        all.par_extend(chunk.map(|index| of(index, &margins(plant, settings, &pairs, index))));
        context.watch.advance(CHUNK.min(count - first))?;
    }
    Ok(all)
}

/// The margins of pair `index` in f64.
pub(super) fn margins(
    plant: &Plant,
    settings: &Settings,
    pairs: &Pairs<'_>,
    index: u64,
) -> PairMargins {
    let [nominal, perturbed] = pairs.pair(index);
    pair_margins(plant, [&nominal, &perturbed], &settings.spec, settings.deviation.control)
}

/// Where pair `index` has its largest drop.
fn widest_at(
    context: Context<'_>,
    settings: &Settings,
    shapes: &Shapes,
    index: u64,
) -> Result<WidestRecord> {
    let pairs = pairs(settings, [purpose::DROPS_NOMINAL, purpose::DROPS_PERTURBATION])?;
    let pair = margins(context.plant(), settings, &pairs, index);
    let scaled = drops(&pair).flat_map(|drop| {
        let (step, [target, constraint]) = (drop.moment.sample(), shapes.scaled(&drop));
        [(target, step, "target"), (constraint, step, "constraint")]
    });
    let (_, step, margin) = scaled.reduce(|a, b| if b.0 > a.0 { b } else { a }).unwrap_or((
        f64::NEG_INFINITY,
        0,
        "target",
    ));
    Ok(WidestRecord { pair: index, step: step as u64, margin: margin.to_owned() })
}

/// The sampling measure of pairs in words.
pub(super) fn measure(model: &Model, settings: &Settings) -> Result<(String, Coordinates)> {
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let coordinates = coordinates(model, &region.varies());
    let (dimension, states) = (coordinates.dimension, model.states.len());
    let words = format!(
        "nominal start uniform in the box, {dimension} of {states} coordinates varying; perturbed \
         start uniform in the Euclidean ball of radius {} around it, all {states} coordinates",
        settings.deviation.radius
    );
    Ok((words, coordinates))
}

/// The claim of `sample` in numbers, and in these words.
pub(super) fn sample_claim(
    model: &Model,
    settings: &Settings,
    sample: &SampleSettings,
    name: &str,
    statement: String,
) -> Result<Claim> {
    let &SampleSettings { epsilon, beta, scenarios, discards } = sample;
    let (measure, Coordinates { dimension, frozen }) = measure(model, settings)?;
    let simple = simple_scenarios(epsilon, beta, 1)?;
    Ok(Claim {
        name: name.to_owned(),
        statement,
        measure,
        dimension,
        frozen,
        scenarios,
        failures: discards,
        decision_vars: 1,
        epsilon: Some(epsilon),
        beta,
        beta_used: beta,
        required_simple: (discards == 0).then_some(simple),
        required_exact: Some(required_with_failures(epsilon, beta, discards)?),
        certified_risk: certified_risk(scenarios, discards, beta),
    })
}

/// The claim in words and numbers.
fn claim(model: &Model, settings: &Settings, asked: &DropSettings) -> Result<Claim> {
    let sample = &asked.sample;
    let SampleSettings { epsilon, beta, scenarios, discards } = *sample;
    let discarded = match discards {
        0 => String::new(),
        _ => format!(" ({discards} of {scenarios} pairs discarded)"),
    };
    let fails = match model.task.is_plain() {
        true => "violates the constraint",
        false => "fails its task",
    };
    let statement = format!(
        "With confidence {}, the margins of a fresh pair drop by at most lambda times the \
         pilot's shapes, at all steps before the nominal rollout {fails}, with \
         probability at least {}{discarded}: the chance that a nominal start of the box is certified at \
         lambda and its perturbed rollout fails is at most {epsilon}.",
        confidence(beta),
        complement(epsilon)
    );
    sample_claim(model, settings, sample, "drops", statement)
}
