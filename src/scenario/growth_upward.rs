//! Growth upward: radii fixed beforehand, tried from the smallest up, all of beta at each.

use super::Context;
use super::bound::certified_risk;
use super::growth_plan::{GrowthMethod, GrowthShape, UpwardRecord};
use super::growth_set::{Drawn, Family, Round, round};
use super::purpose;
use super::record::{RoundRecord, SampleRecord, decimal};
use super::settings::{GrowthSettings, Settings};
use crate::error::{Error, Result};

/// The least share of the largest weight that a coordinate has: the pilot sees no more in few failures.
const LEAST_WEIGHT: f64 = 0.1;
/// Failures below which the pilot says nothing of the axes.
const FEW: usize = 30;

impl GrowthSettings {
    /// The radii of growth upward, in the order in which they are tried: geometric, the radius of the
    /// settings the last.
    pub fn radii(&self) -> Vec<f32> {
        let radius = |down: u32| f64::from(self.radius) / self.plan.factor.powi(down as i32);
        (0..self.rounds).rev().map(|down| radius(down) as f32).collect()
    }

    /// The radius of the first round: the smallest one upward, when shrinking the largest.
    pub(super) fn first_radius(&self) -> f32 {
        match self.plan.method {
            GrowthMethod::Shrinking => self.radius,
            GrowthMethod::Upward => self.radii().first().copied().unwrap_or(self.radius),
        }
    }

    /// Failures that a round of growth upward may have: the most of N with which Clopper and Pearson's
    /// bound at the whole beta is at most the risk asked for; none where even a clean round is too small.
    pub fn allowed_failures(&self) -> Option<u64> {
        let passes = |k: u64| certified_risk(self.scenarios, k, self.beta) <= self.epsilon;
        let [mut low, mut high] = [0, self.scenarios];
        if !passes(0) {
            return None;
        }
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            *(if passes(middle) { &mut low } else { &mut high }) = middle;
        }
        Some(low)
    }

    /// The radius that rounds with these failures verify, tried from the smallest radius up: that of the last
    /// one before the first refusal; none where the first is refused. Rounds after a refusal are not asked for.
    pub fn verified_radius(&self, failures: impl IntoIterator<Item = u64>) -> Option<f32> {
        let allowed = self.allowed_failures().unwrap_or(0);
        let accepted = failures.into_iter().take_while(|failures| *failures <= allowed).count();
        accepted.checked_sub(1).and_then(|last| self.radii().get(last).copied())
    }

    /// Refuses a factor that does not lead upward, and Algorithm 1 of anything but a ball.
    pub(crate) fn check_plan(&self) -> Result<()> {
        let plan = &self.plan;
        if !(plan.factor > 1.0 && plan.factor.is_finite()) {
            let problem = format!("{} is not above 1; radii would not grow", plan.factor);
            return Err(Error::invalid("growth.factor", problem));
        }
        if plan.method == GrowthMethod::Shrinking && plan.shape != GrowthShape::Ball {
            let name = plan.shape.name();
            let problem =
                format!("`{name}` needs `growth.method = \"upward\"`; Algorithm 1 shrinks a ball");
            return Err(Error::invalid("growth.shape", problem));
        }
        let climbs = plan.method == GrowthMethod::Upward;
        if climbs && !self.radii().first().is_some_and(|first| *first > f32::MIN_POSITIVE) {
            let problem =
                format!("{} to the power of {} rounds leaves nothing", plan.factor, self.rounds);
            return Err(Error::invalid("growth.factor", problem));
        }
        Ok(())
    }
}

/// What came of the radii.
pub(super) struct Climb {
    /// The largest radius that was accepted, with those below it.
    pub(super) verified: Option<f32>,
    /// The rounds that were taken, in their order.
    pub(super) rounds: Vec<RoundRecord>,
    /// Starts of the round of that radius, of the first round where none was.
    pub(super) samples: Vec<SampleRecord>,
}

/// Tries the sets of `family` from the smallest radius up, until one is refused: at each, N fresh starts
/// of which at most `allowed` may fail.
///
/// The first radius whose risk is too large is accepted with probability at most beta, and what
/// comes after a refusal is not tried: the radius that is returned is right with confidence 1 - beta.
pub(super) fn climb(
    context: Context<'_>,
    settings: &Settings,
    family: &Family,
    allowed: u64,
    band: f64,
) -> Result<Climb> {
    let asked = &settings.growth;
    context.watch.begin("local growth", asked.scenarios * u64::from(asked.rounds));
    let mut climb = Climb { verified: None, rounds: Vec::new(), samples: Vec::new() };
    for (number, radius) in (0..).zip(asked.radii()) {
        let stream = settings.stream(purpose::GROWTH_UPWARD, number);
        let drawn = Drawn::pictured(stream, asked.scenarios);
        let Round { record, samples } = round(context, settings, family, radius, drawn, band)?;
        let accepted = record.failures <= allowed;
        if accepted || number == 0 {
            climb.samples = samples;
        }
        climb.rounds.push(record);
        if !accepted {
            break;
        }
    }
    climb.verified = asked.verified_radius(climb.rounds.iter().map(|round| round.failures));
    Ok(climb)
}

/// What is fixed before the first round: radii, failures allowed, and the sets, whose axes come from a
/// pilot of its own.
pub(super) fn fixed(
    context: Context<'_>,
    settings: &Settings,
    center: &[f32],
    band: f64,
) -> Result<UpwardRecord> {
    let asked = &settings.growth;
    let balls = Family::balls(center.to_vec(), &asked.varies);
    let mut fixed = UpwardRecord {
        allowed: asked.allowed_failures().unwrap_or(0),
        radii: asked.radii().into_iter().map(decimal).collect(),
        shape: asked.plan.shape,
        widths: balls.widths.clone(),
        pilot: 0,
        pilot_failures: 0,
    };
    if fixed.shape != GrowthShape::Ball {
        let pilot = asked.plan.pilot;
        context.watch.begin("pilot of local growth", pilot);
        let stream = settings.stream(purpose::GROWTH_PILOT, 0);
        let drawn = Drawn { stream, count: pilot, kept: pilot };
        let seen = round(context, settings, &balls, asked.radius, drawn, band)?;
        fixed.widths = widths(&seen.samples, &balls);
        (fixed.pilot, fixed.pilot_failures) = (pilot, seen.record.failures);
    }
    Ok(fixed)
}

/// Half-widths at radius 1 from the starts of a pilot in a ball, their geometric mean 1.
///
/// A half-space that fails, `a'x > b`, is met least by a set of given volume whose widths go as
/// `1 / |a_i|`, and failing starts have a second moment about the centre that exceeds the succeeding
/// ones' by a share that goes as `a_i^2`. So a width is one over the root of that excess, with a floor of a
/// tenth of the largest one. Where few starts fail, or few succeed, all widths are 1.
fn widths(samples: &[SampleRecord], balls: &Family) -> Vec<f32> {
    let of = |success: bool| samples.iter().filter(move |sample| sample.success == success);
    if [true, false].iter().any(|success| of(*success).count() < FEW) {
        return balls.widths.clone();
    }
    let moment = |success: bool, i: usize| {
        let offset = |x: &[f32]| f64::from(x[i]) - f64::from(balls.center[i]);
        let squares = of(success).map(|sample| offset(&sample.x).powi(2));
        squares.sum::<f64>() / of(success).count() as f64
    };
    let varies: Vec<usize> = (0..balls.widths.len()).filter(|&i| balls.widths[i] > 0.0).collect();
    let excess = |&i: &usize| (moment(false, i) / moment(true, i) - 1.0).max(0.0);
    let excess: Vec<f64> = varies.iter().map(excess).collect();
    let largest = excess.iter().copied().fold(0.0, f64::max);
    if largest <= 0.0 {
        return balls.widths.clone();
    }
    let logarithm = |excess: &f64| -0.5 * (excess + LEAST_WEIGHT * largest).ln();
    let logarithms: Vec<f64> = excess.iter().map(logarithm).collect();
    let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
    let mut widths = balls.widths.clone();
    for (&i, logarithm) in varies.iter().zip(logarithms) {
        widths[i] = (logarithm - mean).exp() as f32;
    }
    widths
}
