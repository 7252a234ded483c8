//! The claims of a stored certificate on samples that it has not seen.

use super::criterion::Criterion;
use super::finding::Finding;
use super::record::{DeviationRecord, Record};
use super::refuted::{FALSE_ALARM, refuted, refuted_at, share};
use super::settings::{Joint, Settings};
use super::tier::verified_set;
use super::{
    Context, deterministic_set, fresh_drops, global, pairs_f64, purpose, sequential, sets,
    whole_box,
};
use crate::error::Result;
use crate::rollout::side_by_side::PairGroup;
use crate::rollout::{Keep, Pairs, Query, ReachAvoidTask, Region, Starts, Stream, Tightening};

/// Fresh starts that a verified ball is tried with.
const STARTS: u64 = 20_000;
/// Fresh pairs that the deviation bound is tried with: a risk of a tenth in the place of 0.04 shows.
const PAIRS: u64 = 4_000;
/// Pairs after which the work may be stopped.
const AT_ONCE: u64 = 256;
/// Distance beyond a bound, relative to it, that the bound's own f32 rounding may make.
const ROUNDING: f64 = 1e-5;

/// What fresh samples of `seed` say of the claims of `record`.
pub(super) fn findings(
    context: Context<'_>,
    record: &Record,
    settings: &Settings,
    seed: u64,
) -> Result<Vec<Finding>> {
    let settings = &Settings { seed, ..settings.clone() };
    let mut findings = Vec::from_iter(beyond(context, settings, &record.deviation)?);
    let lost = sets::tightening(record, &settings.spec);
    let criterion = Criterion::new(context.plant(), settings, &lost)?;
    let purposes = [purpose::CHECK, purpose::CHECK_PERTURBATION];
    let fresh = global::conditional(context, settings, &criterion, purposes)?;
    let (failures, accepted) = (fresh.claim.failures, fresh.accepted);
    let name = "conditional failure on fresh pairs";
    findings.push(refuted(name, record.global.claim.certified_risk, failures, accepted));
    let name = "certified share on fresh pairs";
    findings.push(share(name, record.global.share_interval, accepted, fresh.draws));
    findings.extend(fresh_drops::findings(context, record, settings)?);
    if let Some(stored) = &record.whole_box {
        let band = record.global.band;
        findings.push(whole_box::on_fresh_starts(context, settings, stored, band, FALSE_ALARM)?);
    }
    let (sequential, band) = (record.sequential.as_ref(), record.global.band);
    let found = sequential::on_fresh_starts(context, settings, sequential, &criterion, band)?;
    findings.extend(found);
    findings.extend(deterministic_set::adversaries(context, settings)?);
    if let Some(set) = verified_set(&record.growth, settings.state.len()) {
        let failures = in_set(context, settings, set)?;
        let risk = record.growth.claim.as_ref().map_or(0.0, |claim| claim.certified_risk);
        let name = format!("failures in the verified {}", record.growth.shape().name());
        findings.push(refuted(&name, risk, failures, STARTS));
    }
    Ok(findings)
}

/// Whether fresh pairs leave the deviation bound more often than its claim says; nothing of a bound
/// that is none.
fn beyond(
    context: Context<'_>,
    settings: &Settings,
    stored: &DeviationRecord,
) -> Result<Option<Finding>> {
    if stored.non_finite > 0 {
        return Ok(None);
    }
    let counts = pairs_beyond(context, settings, &stored.bound)?;
    let risk = stored.claim.certified_risk;
    let worst = counts.by_step.iter().copied().max().unwrap_or(0);
    let steps = f64::from(settings.spec.horizon);
    Ok(Some(match stored.joint {
        // Each step is a claim of its own.
        Joint::Separate => {
            let name = "fresh pairs beyond the deviation bound, at the worst step";
            refuted_at(FALSE_ALARM / steps, name, risk, worst, PAIRS)
        }
        _ => refuted("fresh pairs beyond the deviation bound", risk, counts.anywhere, PAIRS),
    }))
}

/// Fresh pairs that leave a bound.
struct Beyond {
    /// At some step.
    anywhere: u64,
    /// At each step, `[T + 1]`.
    by_step: Vec<u64>,
}

/// Counts fresh pairs beyond `bound`; step 0 is bounded by the radius that they are drawn with.
fn pairs_beyond(context: Context<'_>, settings: &Settings, bound: &[f64]) -> Result<Beyond> {
    context.watch.begin("fresh deviation pairs", PAIRS);
    let stream = |purpose| Stream::new(settings.seed, purpose, 0);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let pairs = Pairs {
        nominal: Starts::Drawn { region, stream: stream(purpose::FRESH_NOMINAL) },
        radius: settings.deviation.radius,
        stream: stream(purpose::FRESH_PERTURBATION),
    };
    let of = |group: &PairGroup| -> Vec<Vec<bool>> {
        let beyond = |pair: usize| {
            let far = |(distance, bound): (f64, &f64)| distance > bound * (1.0 + ROUNDING);
            let steps = group.distances(pair).into_iter().zip(bound).map(far);
            steps.enumerate().map(|(step, far)| far && step > 0).collect()
        };
        (0..group.count()).map(beyond).collect()
    };
    let mut counts = Beyond { anywhere: 0, by_step: vec![0; bound.len()] };
    for first in (0..PAIRS).step_by(AT_ONCE as usize) {
        let indices: Vec<u64> = (first..PAIRS.min(first + AT_ONCE)).collect();
        let (plant, horizon) = (context.plant(), settings.spec.horizon);
        let control = settings.deviation.control;
        for pair in pairs_f64::groups(plant, &pairs, &indices, horizon, control, of).concat() {
            counts.anywhere += u64::from(pair.contains(&true));
            counts.by_step.iter_mut().zip(pair).for_each(|(count, far)| *count += u64::from(far));
        }
        context.watch.advance(indices.len() as u64)?;
    }
    Ok(counts)
}

/// Failures among fresh starts in the verified set.
fn in_set(context: Context<'_>, settings: &Settings, region: Region) -> Result<u64> {
    context.watch.begin("fresh starts in the verified set", STARTS);
    let stream = Stream::new(settings.seed, purpose::CHECK, 1);
    let tightening = Tightening::none(&settings.spec);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream },
        range: 0..STARTS,
        spec: settings.spec,
        tightening: &tightening,
        query: Query::Sign,
    };
    let advance = &mut |count| context.watch.advance(count);
    Ok(context.program.tally_told(&task, Keep::Counts, advance)?.counts().failures())
}
