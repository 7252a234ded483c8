//! The deviation bound: how far a perturbed rollout strays from its nominal one, per step.

use std::collections::BTreeSet;

use super::bound::{certified_risk, required_scenarios, simple_scenarios, wait_and_judge};
use super::coordinates::{Coordinates, coordinates};
use super::purpose;
use super::record::{Claim, DeviationRecord, decimal};
use super::settings::{DeviationSettings, DeviationSource, Joint, Program, Settings};
use super::{Context, linear};
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::{
    DeviationTask, Farthest, HUGE, Keep, PairControl, PairTally, Pairs, Purpose, Region,
    RolloutSpec, Starts, Tightening,
};
use crate::rounding::{complement, confidence};

/// Draws the pairs and bounds the deviation; method and numbers as `settings` ask.
pub fn bound(context: Context<'_>, settings: &Settings) -> Result<DeviationRecord> {
    let asked = &settings.deviation;
    let program = check_scenarios(asked, settings.spec.horizon)?;
    let exact = exact(context.model(), settings)?;
    let pilot = (asked.joint == Joint::FixedShape).then_some(asked.pilot);
    let shape = match pilot {
        Some(count) => {
            context.watch.begin("pilot pairs", count);
            let purposes = [purpose::PILOT_NOMINAL, purpose::PILOT_PERTURBATION];
            Some(shape(draw(context, settings, purposes, count)?.farthest(), asked.radius))
        }
        None => None,
    };
    context.watch.begin("deviation pairs", asked.scenarios);
    let purposes = [purpose::DEVIATION_NOMINAL, purpose::DEVIATION_PERTURBATION];
    let sample = draw(context, settings, purposes, asked.scenarios)?;
    let (farthest, non_finite) = (sample.farthest(), sample.counts().non_finite);
    let largest: Vec<f64> = farthest.iter().map(|f| f64::from(f.distance)).collect();
    let (bound, scale, support) = conclude(farthest, shape.as_deref(), asked.radius);
    let measured = Measured { bound, largest, scale, support, non_finite };
    record(context.model(), settings, &program, exact, measured)
}

/// What only rollouts tell.
struct Measured {
    /// The scenario bound of each step.
    bound: Vec<f64>,
    largest: Vec<f64>,
    scale: Option<f64>,
    support: u64,
    non_finite: u64,
}

/// The record, with what follows from the settings.
fn record(
    model: &Model,
    settings: &Settings,
    program: &Program,
    exact: Option<Vec<f64>>,
    measured: Measured,
) -> Result<DeviationRecord> {
    let asked = &settings.deviation;
    let Measured { bound, largest, scale, support, non_finite } = measured;
    let bound = match (asked.source, &exact) {
        (DeviationSource::Exact, Some(exact)) => exact.clone(),
        _ => bound,
    };
    Ok(DeviationRecord {
        claim: match non_finite {
            0 => claim(model, settings, program)?,
            broken => {
                let statement = broken_statement(broken, asked.scenarios);
                Claim { statement, ..claim(model, settings, program)? }
            }
        },
        // As it was written: 0.1, not 0.10000000149.
        radius: decimal(asked.radius),
        control: asked.control,
        joint: asked.joint,
        source: asked.source,
        bound,
        largest,
        exact,
        pilot: if asked.joint == Joint::FixedShape { asked.pilot } else { 0 },
        scale,
        support,
        posterior_risk: wait_and_judge(asked.scenarios, support, program.beta),
        non_finite,
    })
}

/// What `stored` says as its own numbers and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: &DeviationRecord,
) -> Result<DeviationRecord> {
    let program = check_scenarios(&settings.deviation, settings.spec.horizon)?;
    let exact = exact(model, settings)?;
    let DeviationRecord { scale, support, non_finite, .. } = *stored;
    let (bound, largest) = (stored.bound.clone(), stored.largest.clone());
    let measured = Measured { bound, largest, scale, support, non_finite };
    record(model, settings, &program, exact, measured)
}

/// The program of the bound; refuses fewer pairs than it needs.
pub(super) fn check_scenarios(asked: &DeviationSettings, horizon: u32) -> Result<Program> {
    let program = Program::new(asked, horizon);
    let need = required_scenarios(program.epsilon, program.beta, program.decision_vars)?;
    if asked.scenarios >= need {
        return Ok(program);
    }
    Err(Error::TooFewScenarios {
        have: asked.scenarios,
        need,
        epsilon: program.epsilon,
        beta: program.beta,
        decision_vars: program.decision_vars,
    })
}

/// The exact supremum, for a system that is linear in its state under replayed controls.
fn exact(model: &Model, settings: &Settings) -> Result<Option<Vec<f64>>> {
    let asked = &settings.deviation;
    let matrix = match asked.control {
        PairControl::Replay => linear::state_matrix(model, settings.spec.horizon),
        // Under feedback the policy bends the dynamics: no single matrix.
        PairControl::ClosedLoop => None,
    };
    if matrix.is_none() && asked.source == DeviationSource::Exact {
        return Err(Error::invalid(
            "deviation.source",
            "`exact` needs a system that is linear in its state and `control = \"replay\"`; \
             use `scenario`",
        ));
    }
    let radius = f64::from(asked.radius);
    let (points, horizon) = (model.points, settings.spec.horizon);
    // The matrix is that of a part: a step has the largest of its sample and of the points before it.
    let by_part = |matrix| linear::exact_deviation(&matrix, radius, horizon * points);
    let by_step = |parts: Vec<f64>| {
        let steps = parts[1..].chunks(points as usize);
        let largest = |period: &[f64]| period.iter().copied().fold(0.0, f64::max);
        std::iter::once(parts[0]).chain(steps.map(largest)).collect()
    };
    Ok(matrix.map(by_part).map(by_step))
}

/// Rolls out `count` pairs of the streams `[nominal, perturbation]`.
fn draw(
    context: Context<'_>,
    settings: &Settings,
    [nominal, perturbation]: [Purpose; 2],
    count: u64,
) -> Result<PairTally> {
    let stream = |purpose| settings.stream(purpose, 0);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: stream(nominal) },
            radius: settings.deviation.radius,
            stream: stream(perturbation),
        },
        range: 0..count,
        spec: settings.spec,
        tightening: &Tightening::none(&settings.spec),
        control: settings.deviation.control,
    };
    let advance = &mut |count| context.watch.advance(count);
    context.program.tally_pairs_told(&task, Keep::Counts, advance)
}

/// The shape that a pilot sample fixes: its largest distances, the radius at step 0.
///
/// A direction that dies out would leave a shape near zero, which one pair could exceed many
/// times over; a thousandth of the radius is the floor.
fn shape(pilot: &[Farthest], radius: f32) -> Vec<f64> {
    let floor = f64::from(radius) * 1e-3;
    let rest = pilot.iter().skip(1).map(|farthest| f64::from(farthest.distance).max(floor));
    std::iter::once(f64::from(radius)).chain(rest).collect()
}

/// The bound at each step, the scale of the shape if one was fixed, and the support scenarios.
///
/// The perturbed start lies in the ball, so step 0 is bounded by the radius (whose f32 rounding
/// the largest distance seen may exceed by an ulp).
fn conclude(
    farthest: &[Farthest],
    shape: Option<&[f64]>,
    radius: f32,
) -> (Vec<f64>, Option<f64>, u64) {
    let seen = || farthest.iter().map(|farthest| f64::from(farthest.distance));
    let Some(shape) = shape else {
        let first = f64::from(radius).max(f64::from(farthest[0].distance));
        let bound = std::iter::once(first).chain(seen().skip(1)).collect();
        let support: BTreeSet<u64> = farthest.iter().skip(1).map(|f| f.pair).collect();
        return (bound, None, support.len() as u64);
    };
    let ratios = seen().zip(shape).skip(1).map(|(distance, shape)| distance / shape);
    let scale = ratios.fold(0.0, f64::max);
    let bound = shape.iter().enumerate().map(|(t, shape)| {
        let scaled = (scale * shape).min(f64::from(HUGE));
        if t == 0 { scaled.max(f64::from(radius)) } else { scaled }
    });
    (bound.collect(), Some(scale), 1)
}

/// That pairs met states that are not finite, so that there is no claim.
fn broken_statement(broken: u64, pairs: u64) -> String {
    format!(
        "The deviation bound is none: {broken} of {pairs} pairs met a state that is not finite, which counts \
         as a distance of {HUGE:e}; no claim follows from it."
    )
}

/// The claim in words and numbers.
fn claim(model: &Model, settings: &Settings, program: &Program) -> Result<Claim> {
    let asked = &settings.deviation;
    let horizon = settings.spec.horizon;
    let joint = match asked.joint {
        Joint::FixedShape => format!("at all steps 0 to {horizon} at once (fixed shape)"),
        Joint::Variables => format!("at all steps 0 to {horizon} at once ({horizon} variables)"),
        Joint::Bonferroni => format!("at all steps 0 to {horizon} at once (Bonferroni)"),
        Joint::Separate => "at each single step (no joint statement)".to_owned(),
    };
    let driven = match asked.control {
        PairControl::Replay => "the same controls replayed",
        PairControl::ClosedLoop => "the policy in feedback on both",
    };
    let sure = match asked.joint {
        Joint::Separate => format!(
            "With confidence {} for each step, and {} for all {horizon} of them",
            confidence(asked.beta),
            confidence(asked.spent(horizon))
        ),
        _ => format!("With confidence {}", confidence(asked.beta)),
    };
    let sure = format!(
        "{sure}, a fresh pair stays within the scenario bound {joint} with probability at least {}, \
         {driven}.",
        complement(asked.epsilon)
    );
    let statement = match asked.source {
        DeviationSource::Scenario => sure,
        DeviationSource::Exact => format!(
            "The margins are tightened with the exact supremum, which no pair exceeds. {sure}"
        ),
    };
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let Coordinates { dimension, frozen } = coordinates(model, &region.varies());
    // Risk of one program, times the programs whose risks add up.
    let programs = asked.epsilon / program.epsilon;
    let risk = certified_risk(asked.scenarios, u64::from(program.decision_vars) - 1, program.beta);
    let states = model.states.len();
    Ok(Claim {
        name: "deviation".to_owned(),
        statement,
        measure: format!(
            "nominal start uniform in the box, {dimension} of {states} coordinates varying; perturbed \
             start uniform in the Euclidean ball of radius {} around it, all {states} coordinates",
            asked.radius
        ),
        dimension,
        frozen,
        scenarios: asked.scenarios,
        failures: 0,
        decision_vars: program.decision_vars,
        epsilon: Some(asked.epsilon),
        beta: asked.beta,
        beta_used: program.beta,
        required_simple: Some(simple_scenarios(
            program.epsilon,
            program.beta,
            program.decision_vars,
        )?),
        required_exact: Some(required_scenarios(
            program.epsilon,
            program.beta,
            program.decision_vars,
        )?),
        certified_risk: (programs * risk).min(1.0),
    })
}

/// What the margins lose at each step: `L_r Delta_t` and `L_c Delta_t`, rounded up to f32.
pub fn tightening(
    bound: &[f64],
    target_constant: f64,
    constraint_constant: f64,
    spec: &RolloutSpec,
) -> Tightening {
    debug_assert_eq!(bound.len(), spec.horizon as usize + 1);
    let scaled = |constant: f64| {
        let loss = bound.iter().map(|bound| (constant * bound).min(f64::from(HUGE)) as f32);
        loss.map(f32::next_up).collect()
    };
    Tightening::losing(scaled(target_constant), scaled(constraint_constant))
}
