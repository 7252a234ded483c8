//! What is stored of each race, step by step: arrays of a batch, padded to the longest race.

use std::collections::BTreeMap;

use super::controller::Decision;
use super::flight::Flight;
use crate::error::Error;
use crate::files::{Array, Data, npz_sha256};
use crate::race::barrier::FilterStatus;

/// Stands for "none" among small numbers.
const NONE: u8 = u8::MAX;

/// A race as it is stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RaceLog {
    /// States, one more than steps.
    pub states: Vec<[f32; 12]>,
    /// What was decided at each step.
    pub steps: Vec<StepLog>,
}

/// What was decided at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLog {
    /// The control.
    pub control: [f32; 3],
    /// The tier, 0 to 3.
    pub tier: Option<u8>,
    /// `V_check`.
    pub check_margin: Option<f32>,
    /// The ball of local growth.
    pub ball: Option<BallLog>,
    /// Effective samples of the plan.
    pub effective_samples: Option<f32>,
    /// Smallest cost of a sample of the plan.
    pub best_cost: Option<f32>,
    /// Samples of the plan whose cost is not finite.
    pub non_finite: u32,
    /// Whether growth was not called because no beta was left.
    pub refused: bool,
    /// Status of the filter, slack in m^2, whether it changed the control.
    pub filter: Option<(FilterStatus, f32, bool)>,
    /// Beta spent.
    pub beta: f64,
    /// Share in the wall time, s.
    pub seconds: f32,
}

/// A ball of local growth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallLog {
    /// Ego x and y of the centre, m.
    pub center: [f32; 2],
    /// Last radius, m.
    pub radius: f32,
    /// Whether it passed clean.
    pub verified: bool,
    /// Rounds taken.
    pub rounds: u32,
    /// Starts run again in f64.
    pub f64_reruns: u32,
}

impl From<&Decision> for StepLog {
    fn from(decision: &Decision) -> Self {
        let ball = decision.growth.as_ref().map(|growth| BallLog {
            center: [growth.ball.center[0], growth.ball.center[2]],
            radius: growth.ball.radius,
            verified: growth.verified,
            rounds: growth.rounds,
            f64_reruns: growth.f64_reruns as u32,
        });
        Self {
            control: decision.control,
            tier: decision.tier.map(|tier| tier.number()),
            check_margin: decision.check_margin,
            ball,
            effective_samples: decision.effective_samples.map(|samples| samples as f32),
            best_cost: decision.best_cost,
            non_finite: decision.non_finite,
            refused: decision.refused,
            filter: decision.filter.map(|log| (log.status, log.slack as f32, log.active)),
            beta: decision.beta,
            seconds: decision.seconds as f32,
        }
    }
}

impl From<&Flight> for RaceLog {
    fn from(flight: &Flight) -> Self {
        let steps = flight.decisions.iter().map(StepLog::from).collect();
        Self { states: flight.states.clone(), steps }
    }
}

/// The arrays of a batch of races of at most `most` steps: `states [races, most + 1, 12]`,
/// `controls [races, most, 3]`, `steps [races]`, and a number per race and step of each of the
/// rest; NaN, 255 or 0 stands where a race is over or has no such number.
pub fn arrays(races: &[RaceLog], most: usize) -> Vec<(&'static str, Array)> {
    let count = races.len();
    let state = |race: &RaceLog, t: usize| race.states.get(t).copied().unwrap_or([f32::NAN; 12]);
    let states = races.iter().flat_map(|race| (0..=most).flat_map(move |t| state(race, t)));
    let control =
        |race: &RaceLog, t: usize| race.steps.get(t).map_or([f32::NAN; 3], |step| step.control);
    let controls = races.iter().flat_map(|race| (0..most).flat_map(move |t| control(race, t)));
    let lengths = races.iter().map(|race| race.steps.len() as u32).collect();
    let floats = |value: &dyn Fn(&StepLog) -> Option<f32>| {
        let each = per_step(races, most, |step| step.and_then(value).unwrap_or(f32::NAN));
        Array { shape: vec![count, most], data: Data::F32(each) }
    };
    let bytes = |value: &dyn Fn(&StepLog) -> Option<u8>| {
        let each = per_step(races, most, |step| step.and_then(value).unwrap_or(NONE));
        Array { shape: vec![count, most], data: Data::U8(each) }
    };
    let counts = |value: &dyn Fn(&StepLog) -> u32| {
        let each = per_step(races, most, |step| step.map_or(0, value));
        Array { shape: vec![count, most], data: Data::U32(each) }
    };
    let spent = per_step(races, most, |step| step.map_or(0.0, |step| step.beta));
    vec![
        ("states", Array { shape: vec![count, most + 1, 12], data: Data::F32(states.collect()) }),
        ("controls", Array { shape: vec![count, most, 3], data: Data::F32(controls.collect()) }),
        ("steps", Array { shape: vec![count], data: Data::U32(lengths) }),
        ("tier", bytes(&|step| step.tier)),
        ("check_margin", floats(&|step| step.check_margin)),
        ("ball_x", floats(&|step| step.ball.map(|ball| ball.center[0]))),
        ("ball_y", floats(&|step| step.ball.map(|ball| ball.center[1]))),
        ("ball_radius", floats(&|step| step.ball.map(|ball| ball.radius))),
        ("ball_verified", bytes(&|step| step.ball.map(|ball| u8::from(ball.verified)))),
        ("growth_rounds", counts(&|step| step.ball.map_or(0, |ball| ball.rounds))),
        ("growth_refused", bytes(&|step| Some(u8::from(step.refused)))),
        ("f64_reruns", counts(&|step| step.ball.map_or(0, |ball| ball.f64_reruns))),
        ("non_finite_samples", counts(&|step| step.non_finite)),
        ("effective_samples", floats(&|step| step.effective_samples)),
        ("best_cost", floats(&|step| step.best_cost)),
        ("filter_status", bytes(&|step| step.filter.map(|(status, ..)| code(status)))),
        ("filter_slack", floats(&|step| step.filter.map(|(_, slack, _)| slack))),
        ("filter_active", bytes(&|step| step.filter.map(|(.., active)| u8::from(active)))),
        ("beta", Array { shape: vec![count, most], data: Data::F64(spent) }),
        ("seconds", floats(&|step| Some(step.seconds))),
    ]
}

/// A value per race and step, race by race.
fn per_step<T>(races: &[RaceLog], most: usize, value: impl Fn(Option<&StepLog>) -> T) -> Vec<T> {
    let place = races.iter().flat_map(|race| (0..most).map(move |t| race.steps.get(t)));
    place.map(value).collect()
}

/// The number of a status in files.
fn code(status: FilterStatus) -> u8 {
    match status {
        FilterStatus::Solved => 0,
        FilterStatus::Inaccurate => 1,
        FilterStatus::Infeasible => 2,
        FilterStatus::Failed => 3,
    }
}

/// The races of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRaces {
    /// The races, in order of their starts.
    pub races: Vec<RaceLog>,
    /// The most steps that there is room for in each.
    pub most: usize,
}

/// The races that the arrays of a file hold; the error says what is wrong with them.
///
/// # Errors
/// A sentence that names the array.
pub fn races(arrays: &BTreeMap<String, Array>) -> Result<StoredRaces, String> {
    let steps = numbers(arrays, "steps", Data::as_u32)?;
    let tiers = numbers(arrays, "tier", Data::as_u8)?;
    let count = steps.len();
    let most = tiers.len() / count.max(1);
    let expect = |name: &str, found: usize, per_race: usize| match found == count * per_race {
        true => Ok(()),
        false => Err(format!("`{name}` has {found} numbers, expected {}", count * per_race)),
    };
    let float = |name: &str| {
        let values = numbers(arrays, name, Data::as_f32)?;
        expect(name, values.len(), most).map(|()| values)
    };
    let byte = |name: &str| {
        let values = numbers(arrays, name, Data::as_u8)?;
        expect(name, values.len(), most).map(|()| values)
    };
    let whole = |name: &str| {
        let values = numbers(arrays, name, Data::as_u32)?;
        expect(name, values.len(), most).map(|()| values)
    };
    let states = numbers(arrays, "states", Data::as_f32)?;
    expect("states", states.len(), 12 * (most + 1))?;
    let controls = numbers(arrays, "controls", Data::as_f32)?;
    expect("controls", controls.len(), 3 * most)?;
    let beta = numbers(arrays, "beta", Data::as_f64)?;
    expect("beta", beta.len(), most)?;
    let (check_margin, radius) = (float("check_margin")?, float("ball_radius")?);
    let (ball_x, ball_y) = (float("ball_x")?, float("ball_y")?);
    let (verified, rounds) = (byte("ball_verified")?, whole("growth_rounds")?);
    let (reruns, effective) = (whole("f64_reruns")?, float("effective_samples")?);
    let best_cost = float("best_cost")?;
    let (non_finite, refused) = (whole("non_finite_samples")?, byte("growth_refused")?);
    if let Some(tier) = tiers.iter().find(|tier| **tier > 3 && **tier != NONE) {
        return Err(format!("`tier` has the number {tier}"));
    }
    let (status, slack) = (byte("filter_status")?, float("filter_slack")?);
    let (active, seconds) = (byte("filter_active")?, float("seconds")?);
    let some = |value: f32| Some(value).filter(|value| !value.is_nan());
    let step = |at: usize| StepLog {
        control: std::array::from_fn(|i| controls[3 * at + i]),
        tier: Some(tiers[at]).filter(|tier| *tier != NONE),
        check_margin: some(check_margin[at]),
        ball: some(radius[at]).map(|radius| BallLog {
            center: [ball_x[at], ball_y[at]],
            radius,
            verified: verified[at] == 1,
            rounds: rounds[at],
            f64_reruns: reruns[at],
        }),
        effective_samples: some(effective[at]),
        best_cost: some(best_cost[at]),
        non_finite: non_finite[at],
        refused: refused[at] == 1,
        filter: decoded(status[at]).map(|status| (status, slack[at], active[at] == 1)),
        beta: beta[at],
        seconds: seconds[at],
    };
    let race = |(number, steps): (usize, &u32)| {
        let steps = *steps as usize;
        if steps > most {
            return Err(format!("`steps` of race {number} is {steps}, at most {most} are stored"));
        }
        let state = |t: usize| {
            let first = 12 * (number * (most + 1) + t);
            std::array::from_fn(|i| states[first + i])
        };
        let decided = (number * most..number * most + steps).map(step).collect();
        Ok(RaceLog { states: (0..=steps).map(state).collect(), steps: decided })
    };
    let races = steps.iter().enumerate().map(race).collect::<Result<_, String>>()?;
    Ok(StoredRaces { races, most })
}

/// The status of a number in files.
fn decoded(code: u8) -> Option<FilterStatus> {
    match code {
        0 => Some(FilterStatus::Solved),
        1 => Some(FilterStatus::Inaccurate),
        2 => Some(FilterStatus::Infeasible),
        3 => Some(FilterStatus::Failed),
        _ => None,
    }
}

/// The numbers of the array `name`.
fn numbers<'a, T>(
    arrays: &'a BTreeMap<String, Array>,
    name: &str,
    part: fn(&Data) -> Option<&[T]>,
) -> Result<&'a [T], String> {
    let array = arrays.get(name).ok_or_else(|| format!("no array `{name}`"))?;
    part(&array.data).ok_or_else(|| format!("`{name}` has numbers of another type"))
}

/// The array of the digest.
const DIGEST: &str = "sha256";

/// The arrays and a digest, as hexadecimal letters, over them and `label`, which says what races
/// they are of.
pub(super) fn sealed(
    mut arrays: Vec<(&'static str, Array)>,
    label: &str,
) -> Vec<(&'static str, Array)> {
    let digest = npz_sha256(label, arrays.iter().map(|(name, array)| (*name, array)));
    let digest = Array { shape: vec![digest.len()], data: Data::U8(digest.into_bytes()) };
    arrays.push((DIGEST, digest));
    arrays
}

/// Whether the arrays are as [`sealed`] left them, with the same label.
pub(super) fn is_sealed(arrays: &BTreeMap<String, Array>, label: &str) -> bool {
    let others = arrays.iter().filter(|(name, _)| *name != DIGEST);
    let digest = npz_sha256(label, others.map(|(name, array)| (name.as_str(), array)));
    let sealed = arrays.get(DIGEST).and_then(|array| array.data.as_u8());
    sealed == Some(digest.as_bytes())
}

/// The refusal of a file of races.
pub(super) fn damaged(path: &std::path::Path, problem: &str) -> Error {
    let text = format!("{problem}; remove the file, and the races are flown again");
    Error::file(path, text)
}

#[cfg(test)]
mod tests;
