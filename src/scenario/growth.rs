//! Local growth, Algorithm 1: the largest ball around a boundary point that passes clean.

use super::Context;
use super::bound::{certified_risk, required_scenarios, simple_scenarios};
use super::boundary::{self, Boundary};
use super::coordinates::{Coordinates, coordinates};
use super::purpose;
use super::record::{Claim, GrowthOutcome, GrowthRecord, RoundRecord, SampleRecord, decimal};
use super::settings::{GrowthSettings, Settings};
use super::spacing::is_fine;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::{
    Ball, NON_FINITE, Query, ReachAvoidTask, Region, Starts, Stream, Tightening, replay,
};
use crate::rounding::{complement, lower};

/// Starts of the last round that are kept for the picture.
const KEPT_SAMPLES: u64 = 400;

/// Outcome of the growth.
///
/// Only a round without failure verifies a ball. The paper's listing would return the radius
/// after the last round, which nobody has tested.
#[derive(Clone, Debug, PartialEq)]
pub enum Growth {
    /// The ball passed clean.
    Verified(Ball),
    /// Every round had failures.
    Exhausted {
        /// Radius of the last round.
        last_radius: f32,
    },
}

impl GrowthSettings {
    /// Beta of one round: the procedure stops at the first clean round, so all M rounds must hold
    /// at once (section 8.2).
    pub(super) fn round_beta(&self) -> f64 {
        if self.split_beta { self.beta / f64::from(self.rounds) } else { self.beta }
    }

    /// Beta of one call, all its rounds together.
    pub fn call_beta(&self) -> f64 {
        if self.split_beta { self.beta } else { self.beta * f64::from(self.rounds) }
    }
}

/// What a call of [`grow`] came to.
#[derive(Clone, Debug)]
pub struct GrowthRun {
    /// The outcome.
    pub outcome: Growth,
    /// The rounds that were taken, in their order.
    pub rounds: Vec<RoundRecord>,
    /// Starts of the last round that are kept.
    pub samples: Vec<SampleRecord>,
}

/// What one round showed.
struct Round {
    record: RoundRecord,
    samples: Vec<SampleRecord>,
}

/// Grows a ball around `boundary` for at most M rounds of N fresh starts each. `call` numbers the
/// calls of a run, so that none reuses another's samples.
pub fn grow(
    context: Context<'_>,
    settings: &Settings,
    boundary: &Boundary,
    band: f64,
    call: u32,
) -> Result<GrowthRun> {
    let asked = &settings.growth;
    check_scenarios(asked)?;
    let mut ball = Ball {
        center: boundary.point.clone(),
        radius: asked.radius,
        varies: asked.varies.to_vec(),
    };
    let mut rounds = Vec::new();
    let mut samples = Vec::new();
    context.watch.begin("local growth", asked.scenarios * u64::from(asked.rounds));
    for number in 0..asked.rounds {
        let stream = Stream::new(settings.seed, purpose::GROWTH, call * asked.rounds + number);
        let round = round(context, settings, &ball, stream, band)?;
        samples = round.samples;
        let nearest = round.record.nearest_failure;
        rounds.push(round.record);
        match nearest {
            None => {
                let outcome = Growth::Verified(ball);
                return Ok(GrowthRun { outcome, rounds, samples });
            }
            Some(distance) => match next_ball(asked, number, &ball, distance) {
                Some(next) => ball = next,
                None => break,
            },
        }
    }
    let outcome = Growth::Exhausted { last_radius: ball.radius };
    Ok(GrowthRun { outcome, rounds, samples })
}

/// The ball of the round after `number`, whose nearest failure was that far; none after the last round,
/// and where nothing is left that f32 has points enough for.
pub(super) fn next_ball(
    asked: &GrowthSettings,
    number: u32,
    ball: &Ball,
    nearest: f64,
) -> Option<Ball> {
    // Rounded down: the failure itself stays outside.
    let radius = (nearest as f32).next_down();
    let next = Ball { radius, ..ball.clone() };
    Some(next).filter(|next| number + 1 < asked.rounds && next.radius > 0.0 && is_fine(next))
}

/// Refuses fewer starts than one clean round needs.
pub(crate) fn check_scenarios(asked: &GrowthSettings) -> Result<()> {
    let need = required_scenarios(asked.epsilon, asked.round_beta(), 1)?;
    if asked.scenarios >= need {
        return Ok(());
    }
    Err(Error::TooFewScenarios {
        have: asked.scenarios,
        need,
        epsilon: asked.epsilon,
        beta: asked.round_beta(),
        decision_vars: 1,
    })
}

/// One round: N fresh starts in the ball, their outcomes, and the nearest failure.
fn round(
    context: Context<'_>,
    settings: &Settings,
    ball: &Ball,
    stream: Stream,
    band: f64,
) -> Result<Round> {
    let starts = Starts::Drawn { region: Region::Ball(ball.clone()), stream };
    let tightening = Tightening::none(&settings.spec);
    let task = ReachAvoidTask {
        starts,
        range: 0..settings.growth.scenarios,
        spec: settings.spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let mut record = RoundRecord {
        radius: decimal(ball.radius),
        scenarios: settings.growth.scenarios,
        failures: 0,
        nearest_failure: None,
        non_finite: 0,
        f64_reruns: 0,
    };
    let mut samples = Vec::new();
    context.program.reach_avoid(&task, &mut |first, values| {
        for (index, value) in (first..).zip(values) {
            let start = task.starts.start(index);
            let mut value = f64::from(*value);
            if value.abs() <= band {
                value = replay::measure(context.plant(), &start, &settings.spec, &tightening);
                record.f64_reruns += 1;
            }
            let success = value > 0.0;
            if !success {
                record.failures += 1;
                record.non_finite += u64::from(value == f64::from(NON_FINITE));
                let distance = ball.distance(&start);
                let nearest = record.nearest_failure.map_or(distance, |n| n.min(distance));
                record.nearest_failure = Some(nearest);
            }
            if index < KEPT_SAMPLES {
                samples.push(SampleRecord { x: start, success });
            }
        }
        context.watch.advance(values.len() as u64)
    })?;
    Ok(Round { record, samples })
}

/// What `stored` says as its own failures and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: &GrowthRecord,
) -> Result<GrowthRecord> {
    let asked = &settings.growth;
    let mut record = GrowthRecord {
        center: stored.center.clone(),
        rounds: stored.rounds.clone(),
        samples: stored.samples.clone(),
        ..nothing(asked)
    };
    let whole = |x: &&Vec<f32>| x.len() == model.states.len();
    let Some(center) = stored.center.as_ref().filter(whole).cloned() else {
        return Ok(record);
    };
    record.distance = Some(boundary::distance(&center, &settings.state));
    record.outcome = GrowthOutcome::Exhausted;
    let mut ball = Ball { center, radius: asked.radius, varies: asked.varies.to_vec() };
    for (number, round) in (0..).zip(&mut record.rounds) {
        (round.radius, round.scenarios) = (decimal(ball.radius), asked.scenarios);
        let next = round.nearest_failure.and_then(|far| next_ball(asked, number, &ball, far));
        ball = next.unwrap_or(ball);
    }
    if record.rounds.last().is_some_and(|round| round.failures == 0) {
        verified(&mut record, model, settings, ball)?;
    }
    Ok(record)
}

/// The record of a growth that had nothing to grow from.
fn nothing(asked: &GrowthSettings) -> GrowthRecord {
    GrowthRecord {
        outcome: GrowthOutcome::NoBoundary,
        boundary: asked.boundary,
        center: None,
        distance: None,
        radius: 0.0,
        volume: 0.0,
        varies: asked.varies.to_vec(),
        rounds: Vec::new(),
        claim: None,
        samples: Vec::new(),
    }
}

/// Enters a ball that passed clean.
fn verified(
    record: &mut GrowthRecord,
    model: &Model,
    settings: &Settings,
    ball: Ball,
) -> Result<()> {
    record.outcome = GrowthOutcome::Verified;
    record.radius = decimal(ball.radius);
    record.claim = Some(claim(model, settings, &ball)?);
    record.volume = Region::Ball(ball).volume();
    Ok(())
}

/// The growth as a record: boundary search, rounds, outcome and claim.
pub(super) fn record(
    context: Context<'_>,
    settings: &Settings,
    boundary: Option<Boundary>,
    band: f64,
) -> Result<GrowthRecord> {
    let asked = &settings.growth;
    check_scenarios(asked)?;
    let mut record = nothing(asked);
    let Some(boundary) = boundary else {
        return Ok(record);
    };
    record.center = Some(boundary.point.clone());
    record.distance = Some(boundary.distance);
    let GrowthRun { outcome, rounds, samples } = grow(context, settings, &boundary, band, 0)?;
    record.rounds = rounds;
    record.samples = samples;
    record.outcome = GrowthOutcome::Exhausted;
    if let Growth::Verified(ball) = outcome {
        verified(&mut record, context.model(), settings, ball)?;
    }
    Ok(record)
}

/// The claim in words and numbers.
fn claim(model: &Model, settings: &Settings, ball: &Ball) -> Result<Claim> {
    let asked = &settings.growth;
    let (beta_used, states) = (asked.round_beta(), model.states.len());
    let Coordinates { dimension, frozen } = coordinates(model, &asked.varies);
    Ok(Claim {
        name: "growth".to_owned(),
        statement: format!(
            "With confidence 1 - {}, a start drawn from the verified ball of radius {} reaches \
             the target safely within {} steps with probability at least {}{}.",
            asked.beta,
            lower(decimal(ball.radius)),
            settings.spec.horizon,
            complement(asked.epsilon),
            if asked.split_beta || asked.rounds == 1 {
                ""
            } else {
                " (as published: each round spends all of beta, which holds for one round only)"
            }
        ),
        measure: format!(
            "start uniform in the Euclidean ball of radius {} in {}",
            lower(decimal(ball.radius)),
            match dimension {
                all if all == states => format!("all {states} coordinates"),
                some => format!(
                    "{some} of {states} coordinates, the others frozen at the centre's values"
                ),
            }
        ),
        dimension,
        frozen,
        scenarios: asked.scenarios,
        failures: 0,
        decision_vars: 1,
        epsilon: Some(asked.epsilon),
        beta: asked.beta,
        beta_used,
        required_simple: Some(simple_scenarios(asked.epsilon, beta_used, 1)?),
        required_exact: Some(required_scenarios(asked.epsilon, beta_used, 1)?),
        certified_risk: certified_risk(asked.scenarios, 0, beta_used),
    })
}
