//! Local growth: Algorithm 1, the largest ball around a boundary point that passes clean, and the record
//! of either method.

use super::Context;
use super::bound::{certified_risk, required_scenarios, required_with_failures, simple_scenarios};
use super::boundary::{self, Boundary, Center};
use super::coordinates::{Coordinates, coordinates};
use super::growth_plan::{Around, GrowthMethod, GrowthShape, UpwardRecord};
use super::growth_set::{Drawn, Family, round};
use super::growth_upward::{climb, fixed};
use super::purpose;
use super::record::{Claim, GrowthOutcome, GrowthRecord, RoundRecord, SampleRecord, decimal};
use super::settings::{GrowthSettings, Settings};
use super::spacing::is_fine;
use crate::error::{Error, Result};
use crate::model::{Form, Model};
use crate::rollout::Ball;
use crate::rounding::{complement, confidence, lower};

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
    /// at once (section 8.2). Upward all of beta: a fixed sequence is refused for good by its first refusal.
    pub(super) fn round_beta(&self) -> f64 {
        self.beta / if self.split_beta { f64::from(self.booked_rounds()) } else { 1.0 }
    }

    /// Beta of one call, all its rounds together.
    pub fn call_beta(&self) -> f64 {
        if self.split_beta { self.beta } else { self.beta * f64::from(self.booked_rounds()) }
    }

    /// Rounds that spend beta, each of its own: all of Algorithm 1, upward as one.
    pub(super) fn booked_rounds(&self) -> u32 {
        match self.plan.method {
            GrowthMethod::Shrinking => self.rounds,
            GrowthMethod::Upward => 1,
        }
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

/// Grows a ball around `boundary` by Algorithm 1, for at most M rounds of N fresh starts each. `call` numbers the
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
        let stream = settings.stream(purpose::GROWTH, call * asked.rounds + number);
        let family = Family::balls(ball.center.clone(), &ball.varies);
        let drawn = Drawn::pictured(stream, asked.scenarios);
        let round = round(context, settings, &family, ball.radius, drawn, band)?;
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

/// What `stored` says as its own failures and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: &GrowthRecord,
) -> Result<GrowthRecord> {
    let asked = &settings.growth;
    let mut record = GrowthRecord {
        around: stored.around,
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
    if let Some(upward) =
        stored.upward.clone().filter(|_| asked.plan.method == GrowthMethod::Upward)
    {
        return derived_upward(model, settings, record, upward);
    }
    let mut ball = Ball { center, radius: asked.radius, varies: asked.varies.to_vec() };
    for (number, round) in (0..).zip(&mut record.rounds) {
        (round.radius, round.scenarios) = (decimal(ball.radius), asked.scenarios);
        let next = round.nearest_failure.and_then(|far| next_ball(asked, number, &ball, far));
        ball = next.unwrap_or(ball);
    }
    if record.rounds.last().is_some_and(|round| round.failures == 0) {
        let family = Family::balls(ball.center, &ball.varies);
        verified(&mut record, model, settings, &family, ball.radius)?;
    }
    Ok(record)
}

/// The record of a growth upward as its own failures and `settings` give it; the widths are the pilot's.
fn derived_upward(
    model: &Model,
    settings: &Settings,
    mut record: GrowthRecord,
    stored: UpwardRecord,
) -> Result<GrowthRecord> {
    let asked = &settings.growth;
    let allowed = asked.allowed_failures().unwrap_or(0);
    for (round, radius) in record.rounds.iter_mut().zip(asked.radii()) {
        (round.radius, round.scenarios) = (decimal(radius), asked.scenarios);
    }
    let radius = asked.verified_radius(record.rounds.iter().map(|round| round.failures));
    let radii = asked.radii().into_iter().map(decimal).collect();
    let mut upward = UpwardRecord { allowed, radii, shape: asked.plan.shape, ..stored };
    if upward.shape == GrowthShape::Ball {
        upward.widths = Family::balls(Vec::new(), &asked.varies).widths;
        (upward.pilot, upward.pilot_failures) = (0, 0);
    } else {
        upward.pilot = asked.plan.pilot;
    }
    conclude_upward(&mut record, model, settings, upward, radius)?;
    Ok(record)
}

/// Enters what growth upward came to.
fn conclude_upward(
    record: &mut GrowthRecord,
    model: &Model,
    settings: &Settings,
    upward: UpwardRecord,
    radius: Option<f32>,
) -> Result<()> {
    let family = upward.family(record.center.clone().unwrap_or_default());
    record.upward = Some(upward);
    match radius.filter(|_| family.widths.len() == model.states.len()) {
        Some(radius) => verified(record, model, settings, &family, radius),
        None => Ok(()),
    }
}

/// The record of a growth that had nothing to grow from.
fn nothing(asked: &GrowthSettings) -> GrowthRecord {
    GrowthRecord {
        outcome: GrowthOutcome::NoBoundary,
        boundary: asked.boundary,
        around: Around::Set,
        center: None,
        distance: None,
        radius: 0.0,
        volume: 0.0,
        varies: asked.varies.to_vec(),
        rounds: Vec::new(),
        claim: None,
        samples: Vec::new(),
        upward: None,
    }
}

/// Enters a set that passed.
fn verified(
    record: &mut GrowthRecord,
    model: &Model,
    settings: &Settings,
    family: &Family,
    radius: f32,
) -> Result<()> {
    record.outcome = GrowthOutcome::Verified;
    record.radius = decimal(radius);
    record.volume = family.at(radius).volume();
    record.claim = Some(claim(model, settings, record)?);
    Ok(())
}

/// The growth as a record: boundary search, rounds, outcome and claim.
pub(super) fn record(
    context: Context<'_>,
    settings: &Settings,
    center: Option<Center>,
    band: f64,
) -> Result<GrowthRecord> {
    let asked = &settings.growth;
    check_scenarios(asked)?;
    let mut record = nothing(asked);
    let Some(Center { around, boundary }) = center else {
        return Ok(record);
    };
    record.around = around;
    record.center = Some(boundary.point.clone());
    record.distance = Some(boundary.distance);
    record.outcome = GrowthOutcome::Exhausted;
    if asked.plan.method == GrowthMethod::Upward {
        let upward = fixed(context, settings, &boundary.point, band)?;
        let family = upward.family(boundary.point);
        let climb = climb(context, settings, &family, upward.allowed, band)?;
        (record.rounds, record.samples) = (climb.rounds, climb.samples);
        conclude_upward(&mut record, context.model(), settings, upward, climb.verified)?;
        return Ok(record);
    }
    let GrowthRun { outcome, rounds, samples } = grow(context, settings, &boundary, band, 0)?;
    record.rounds = rounds;
    record.samples = samples;
    if let Growth::Verified(ball) = outcome {
        let family = Family::balls(ball.center, &ball.varies);
        verified(&mut record, context.model(), settings, &family, ball.radius)?;
    }
    Ok(record)
}

/// The claim in words and numbers.
fn claim(model: &Model, settings: &Settings, record: &GrowthRecord) -> Result<Claim> {
    let asked = &settings.growth;
    let (beta_used, states) = (asked.round_beta(), model.states.len());
    let Coordinates { dimension, frozen } = coordinates(model, &asked.varies);
    let passed = || record.rounds.iter().find(|round| round.radius == record.radius);
    // The failures that were allowed, not those that were seen: which round is the last depends on these.
    let allowed = record.upward.as_ref().map_or(0, |upward| upward.allowed);
    let set = set_words(record);
    let norm = if record.shape() == GrowthShape::Ball { "Euclidean " } else { "" };
    Ok(Claim {
        name: "growth".to_owned(),
        statement: format!(
            "With confidence {}, a start drawn from the verified {set} {} with probability at least {}{}.",
            confidence(asked.beta),
            model.task.words(Form::One, settings.spec.horizon),
            complement(asked.epsilon),
            spent_words(asked, allowed)
        ),
        measure: format!(
            "start uniform in the {norm}{set} in {}",
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
        failures: passed().map_or(0, |round| round.failures),
        decision_vars: 1,
        epsilon: Some(asked.epsilon),
        beta: asked.beta,
        beta_used,
        // The simple bound knows no failures that are allowed.
        required_simple: match allowed {
            0 => Some(simple_scenarios(asked.epsilon, beta_used, 1)?),
            _ => None,
        },
        required_exact: Some(required_with_failures(asked.epsilon, beta_used, allowed)?),
        certified_risk: certified_risk(asked.scenarios, allowed, beta_used),
    })
}

impl GrowthRecord {
    /// What grew.
    pub fn shape(&self) -> GrowthShape {
        self.upward.as_ref().map_or(GrowthShape::Ball, |upward| upward.shape)
    }
}

/// The verified set in words.
fn set_words(record: &GrowthRecord) -> String {
    let (name, radius) = (record.shape().name(), lower(record.radius));
    match record.shape() {
        GrowthShape::Ball => format!("{name} of radius {radius}"),
        _ => format!("{name} of radius {radius} (of equal volume or mean side)"),
    }
}

/// How beta is spent, where it needs a word.
fn spent_words(asked: &GrowthSettings, allowed: u64) -> String {
    match asked.plan.method {
        GrowthMethod::Upward => format!(
            " (radii fixed beforehand and tried from the smallest up, with all of beta, until one has more \
             than {allowed} failures among {})",
            asked.scenarios
        ),
        GrowthMethod::Shrinking if asked.split_beta || asked.rounds == 1 => String::new(),
        GrowthMethod::Shrinking => {
            " (as published: each round spends all of beta, which holds for one round only)"
                .to_owned()
        }
    }
}
