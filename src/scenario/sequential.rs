//! Sequential claims: starts are looked at one after the other, until the claim holds or is hopeless.

use std::ops::Range;

use super::Context;
use super::bound::{required_scenarios, simple_scenarios};
use super::coordinates::{Coordinates, coordinates};
use super::criterion::Criterion;
use super::evidence::Evidence;
use super::finding::Finding;
use super::purpose;
use super::record::{Claim, decimal};
use super::refuted::refuted;
use super::sequential_record::{
    EvidencePoint, SequentialOf, SequentialOutcome, SequentialRecord, SequentialSettings,
};
use super::settings::Settings;
use super::walk::Walk;
use crate::error::Result;
use crate::model::Model;
use crate::rollout::{Ball, DeviationTask, Pairs, Region, Starts, replay};
use crate::rounding::{confidence, lower};

/// Draws of the first batch; each next one has twice as many.
const FIRST_BATCH: u64 = 256;
/// Most draws of a batch.
const LARGEST_BATCH: u64 = 16_384;
/// Evidence of a risk that is too large at which the work stops: one in a thousand.
const HOPELESS: f64 = 1000.0;

/// Starts so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    draws: u64,
    starts: u64,
    failures: u64,
}

/// Looks at starts until one of the ends is reached; no claim where none is asked for. Measures within
/// `band` of zero are those of f64.
pub(super) fn record(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Option<SequentialRecord>> {
    let Some(asked) = &settings.sequential else { return Ok(None) };
    let (evidence, mut counts) = (Evidence::new(asked.epsilon), Counts::default());
    let (mut process, mut batch) = (Vec::new(), FIRST_BATCH);
    context.watch.begin("sequential claim", asked.most);
    while counts.draws < asked.most && asked.end(counts.failures, counts.starts).is_none() {
        let range = counts.draws..asked.most.min(counts.draws + batch);
        batch = LARGEST_BATCH.min(2 * batch);
        for failed in outcomes(context, settings, asked, range, criterion, band)? {
            counts.draws += 1;
            let Some(failed) = failed else { continue };
            counts.starts += 1;
            counts.failures += u64::from(failed);
            if is_kept(counts.starts) {
                process.push(point(asked, &evidence, counts));
            }
            if asked.end(counts.failures, counts.starts).is_some() {
                break;
            }
        }
    }
    if process.last().is_none_or(|last: &EvidencePoint| last.starts < counts.starts) {
        process.push(point(asked, &evidence, counts));
    }
    conclude(context.model(), settings, asked, counts, process).map(Some)
}

/// What `stored` says as its own counts and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: Option<&SequentialRecord>,
) -> Result<Option<SequentialRecord>> {
    let (Some(asked), Some(stored)) = (&settings.sequential, stored) else { return Ok(None) };
    let evidence = Evidence::new(asked.epsilon);
    let again = |seen: &EvidencePoint| {
        let EvidencePoint { starts, failures, .. } = *seen;
        point(asked, &evidence, Counts { draws: 0, starts, failures })
    };
    let process = stored.process.iter().map(again).collect();
    let Claim { scenarios: starts, failures, .. } = stored.claim;
    let counts = Counts { draws: stored.draws, starts, failures };
    conclude(model, settings, asked, counts, process).map(Some)
}

/// Whether fresh draws of the seed of `settings` refute what `stored` claims; nothing of a claim that was not
/// obtained.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn on_fresh_starts(
    context: Context<'_>,
    settings: &Settings,
    stored: Option<&SequentialRecord>,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Option<Finding>> {
    let obtained = stored.filter(|one| one.outcome == SequentialOutcome::Certified);
    let (Some(asked), Some(stored)) = (&settings.sequential, obtained) else { return Ok(None) };
    let draws = settings.global.draws;
    context.watch.begin("fresh starts of the sequential claim", draws);
    let outcomes = outcomes(context, settings, asked, 0..draws, criterion, band)?;
    let of_claim = outcomes.iter().flatten();
    let (starts, failures) = (of_claim.clone().count(), of_claim.filter(|failed| **failed).count());
    let name = "failures of the sequential claim on fresh starts";
    Ok(Some(refuted(name, stored.claim.certified_risk, failures as u64, starts as u64)))
}

/// Whether the process is kept after that many starts.
fn is_kept(starts: u64) -> bool {
    starts.is_multiple_of(1 << starts.ilog2().saturating_sub(5))
}

/// The process after `counts`.
fn point(asked: &SequentialSettings, evidence: &Evidence, counts: Counts) -> EvidencePoint {
    let Counts { starts, failures, .. } = counts;
    EvidencePoint { starts, failures, log_e: asked.carried + evidence.ln_e(failures, starts) }
}

impl SequentialSettings {
    /// What ends the work after `failures` of `starts`; none where it goes on.
    pub fn end(&self, failures: u64, starts: u64) -> Option<SequentialOutcome> {
        let evidence = Evidence::new(self.epsilon);
        if self.carried + evidence.ln_e(failures, starts) >= -self.beta.ln() {
            return Some(SequentialOutcome::Certified);
        }
        let hopeless = evidence.ln_against(failures, starts) >= HOPELESS.ln();
        hopeless.then_some(SequentialOutcome::Hopeless)
    }
}

/// Whether each of the draws `range` fails; none of a draw that is not one of the claim's.
fn outcomes(
    context: Context<'_>,
    settings: &Settings,
    asked: &SequentialSettings,
    range: Range<u64>,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Vec<Option<bool>>> {
    match asked.of {
        SequentialOf::Set => of_set(context, settings, range, criterion, band),
        _ => of_region(context, settings, asked, range, band),
    }
}

/// Perturbed starts of the certified set.
fn of_set(
    context: Context<'_>,
    settings: &Settings,
    range: Range<u64>,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Vec<Option<bool>>> {
    let tightening = &criterion.tightening(&settings.spec);
    let stream = |purpose| settings.stream(purpose, 0);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: stream(purpose::SEQUENTIAL) },
            radius: settings.deviation.radius,
            stream: stream(purpose::SEQUENTIAL_PERTURBATION),
        },
        range,
        spec: settings.spec,
        tightening,
        control: settings.deviation.control,
    };
    let mut outcomes = Vec::new();
    context.program.deviation(&task, &mut |first, pairs| {
        let enclosed = criterion.enclosed(context, &task, first, pairs, band)?;
        for (index, pair) in (first..).zip(pairs) {
            let (mut nominal, mut perturbed) = (f64::from(pair.nominal), f64::from(pair.perturbed));
            if nominal.abs() <= band || perturbed.abs() <= band {
                let [from, beside] = task.pairs.pair(index);
                let (plant, pair) = (context.plant(), [&*from, &*beside]);
                (nominal, perturbed) =
                    replay::pair_measures(plant, pair, &task.spec, tightening, task.control);
            }
            // A measure that is no number is a failure.
            let place = (index - first) as usize;
            let certified = enclosed.as_ref().map_or(nominal > 0.0, |all| all[place]);
            outcomes.push(certified.then(|| perturbed.is_nan() || perturbed <= 0.0));
        }
        context.watch.advance(pairs.len() as u64)
    })?;
    Ok(outcomes)
}

/// Starts of the box or of the ball, as they are.
fn of_region(
    context: Context<'_>,
    settings: &Settings,
    asked: &SequentialSettings,
    range: Range<u64>,
    band: f64,
) -> Result<Vec<Option<bool>>> {
    let stream = settings.stream(purpose::SEQUENTIAL, 1);
    let starts = Starts::Drawn { region: region(settings, asked)?, stream };
    let mut outcomes = Vec::new();
    Walk { starts, range, spec: settings.spec, band }
        .each(context, |rolled| outcomes.push(Some(rolled.failed())))?;
    Ok(outcomes)
}

/// Where starts are drawn, or for the set their nominal starts.
pub(super) fn region(settings: &Settings, asked: &SequentialSettings) -> Result<Region> {
    match asked.of {
        SequentialOf::Ball => Ok(Region::Ball(Ball {
            center: settings.state.clone(),
            radius: asked.radius,
            varies: settings.growth.varies.clone(),
        })),
        _ => Region::new_box(&*settings.low, &*settings.high),
    }
}

/// What the counts support.
fn conclude(
    model: &Model,
    settings: &Settings,
    asked: &SequentialSettings,
    counts: Counts,
    process: Vec<EvidencePoint>,
) -> Result<SequentialRecord> {
    let evidence = Evidence::new(asked.epsilon);
    let outcome = asked.end(counts.failures, counts.starts).unwrap_or(SequentialOutcome::Undecided);
    Ok(SequentialRecord {
        of: asked.of,
        claim: claim(model, settings, asked, counts, outcome)?,
        outcome,
        draws: counts.draws,
        log_e: point(asked, &evidence, counts).log_e,
        log_needed: -asked.beta.ln(),
        log_against: evidence.ln_against(counts.failures, counts.starts),
        carried: asked.carried,
        process,
    })
}

/// The claim in words and numbers.
fn claim(
    model: &Model,
    settings: &Settings,
    asked: &SequentialSettings,
    counts: Counts,
    outcome: SequentialOutcome,
) -> Result<Claim> {
    let varies = region(settings, asked)?.varies();
    let Coordinates { dimension, frozen } = coordinates(model, &varies);
    let whose = whose(settings, asked);
    let Counts { starts, failures, .. } = counts;
    let (epsilon, beta) = (asked.epsilon, asked.beta);
    let mut seen = format!("{failures} of {starts} starts failed");
    if asked.carried != 0.0 {
        seen += &format!(
            "; with log evidence of {} carried over from earlier attempts, as `sequential.carried` says",
            lower(asked.carried)
        );
    }
    let statement = match outcome {
        SequentialOutcome::Certified => format!(
            "With confidence {}, {whose} fails with probability at most {epsilon}: shown after \
             {starts} starts, looked at one after the other ({seen}).",
            confidence(beta)
        ),
        SequentialOutcome::Hopeless => format!(
            "It is not shown that {whose} fails with probability at most {epsilon}, and it is hopeless: {seen}."
        ),
        SequentialOutcome::Undecided => format!(
            "It is not shown that {whose} fails with probability at most {epsilon}: after {} draws {seen}; \
             `sequential.most` allows no more.",
            counts.draws
        ),
    };
    let certified = outcome == SequentialOutcome::Certified;
    Ok(Claim {
        name: "sequential".to_owned(),
        statement,
        measure: whose,
        dimension,
        frozen,
        scenarios: starts,
        failures,
        decision_vars: 1,
        epsilon: Some(epsilon),
        beta,
        beta_used: beta,
        // What a sample of a size fixed beforehand would need, without failure.
        required_simple: Some(simple_scenarios(epsilon, beta, 1)?),
        required_exact: Some(required_scenarios(epsilon, beta, 1)?),
        certified_risk: if certified { epsilon } else { 1.0 },
    })
}

/// The starts in words.
fn whose(settings: &Settings, asked: &SequentialSettings) -> String {
    match asked.of {
        SequentialOf::Ball => format!(
            "a start uniform in the Euclidean ball of radius {} around the state",
            decimal(asked.radius)
        ),
        SequentialOf::Set => format!(
            "a perturbed rollout (within {}) whose nominal start is drawn from the box and certified",
            decimal(settings.deviation.radius)
        ),
        _ => "a start uniform in the box".to_owned(),
    }
}
