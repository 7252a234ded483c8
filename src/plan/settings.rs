//! The settings of plans in closed loop: the section `[plan]` of a configuration.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::rollout::{MAX_HORIZON, MppiSettings, MppiSpec, NoiseKind, Sigma};
use crate::system::Axis;

/// Most runs: each has random streams of its own, one for each of its steps.
pub const MOST_RUNS: u32 = 1000;
/// Most improvements of a plan at each control step: more is a slip.
const MOST_ITERATIONS: u32 = 1000;
/// Share of a control's range that its noise has as standard deviation where nobody says.
const SPREAD: f32 = 0.25;

/// How plans are made and for how long a model is steered by them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlanSettings {
    /// Samples K of each plan.
    pub samples: u32,
    /// Steps H of a plan.
    pub horizon: u32,
    /// Temperature lambda, in units of cost.
    pub temperature: f32,
    /// Standard deviation of the noise; a quarter of each control's range where nothing is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<SigmaSetting>,
    /// Improvements of a plan at each control step.
    pub iterations: u32,
    /// How the noise hangs together over the steps.
    pub noise: NoiseKind,
    /// Whether samples come in mirrored pairs.
    pub antithetic: bool,
    /// Whether samples pay for their noise.
    pub noise_cost: bool,
    /// What the first plan of a run is.
    pub first_plan: FirstPlan,
    /// Control steps of a run; the horizon of a rollout where nothing is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<u32>,
    /// Runs: one from the configuration's state, several from starts drawn from its box.
    pub runs: u32,
}

impl Default for PlanSettings {
    fn default() -> Self {
        Self {
            samples: 1024,
            horizon: 30,
            temperature: 1.0,
            sigma: None,
            iterations: 1,
            noise: NoiseKind::Independent,
            antithetic: false,
            noise_cost: false,
            first_plan: FirstPlan::Middle,
            steps: None,
            runs: 1,
        }
    }
}

/// What the first plan of a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstPlan {
    /// The middle of each control's bounds at every step.
    Middle,
    /// A rollout of the policy.
    Policy,
}

/// Standard deviation of the noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, a list with a number for each control, or a covariance matrix"
)]
pub enum SigmaSetting {
    /// The same for each control.
    Same(f32),
    /// One for each control, in order.
    PerControl(Vec<f32>),
    /// The covariance matrix.
    Covariance(Vec<Vec<f32>>),
}

impl PlanSettings {
    /// Control steps of a run, where a rollout has `horizon` of them.
    pub fn steps(&self, horizon: u32) -> u32 {
        self.steps.unwrap_or(horizon)
    }

    /// What plans for a model with these controls are improved with.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key: runs, steps or iterations out of range, a control with an open
    /// bound, no control whose bounds have a width, a sigma that leaves none any noise, and those of
    /// [`MppiSpec::new`].
    pub fn spec(&self, controls: &[Axis]) -> Result<MppiSpec> {
        within("plan.runs", self.runs, MOST_RUNS)?;
        within("plan.iterations", self.iterations, MOST_ITERATIONS)?;
        self.steps.map_or(Ok(()), |steps| within("plan.steps", steps, MAX_HORIZON))?;
        check_bounds(controls)?;
        let settings = MppiSettings {
            temperature: self.temperature,
            sigma: self.sigma(controls)?,
            noise: self.noise,
            antithetic: self.antithetic,
            noise_cost: self.noise_cost,
            ..MppiSettings::new(controls, self.samples, self.horizon)
        };
        MppiSpec::new(settings).map_err(|error| match error {
            Error::Invalid { place, problem } => Error::invalid(format!("plan.{place}"), problem),
            other => other,
        })
    }

    /// The noise of each control.
    fn sigma(&self, controls: &[Axis]) -> Result<Sigma> {
        let quarter = |axis: &Axis| SPREAD * (axis.high - axis.low);
        let per_control = match &self.sigma {
            None => controls.iter().map(quarter).collect(),
            Some(SigmaSetting::Same(sigma)) => vec![*sigma; controls.len()],
            Some(SigmaSetting::PerControl(sigma)) => {
                count("numbers", sigma.len(), controls)?;
                sigma.clone()
            }
            Some(SigmaSetting::Covariance(rows)) => {
                count("rows", rows.len(), controls)?;
                return Ok(Sigma::Covariance(rows.clone()));
            }
        };
        if per_control.iter().all(|sigma| *sigma == 0.0) {
            let problem = "0 for every control: all samples are the plan itself, so nothing is \
                           improved; give a positive number";
            return Err(Error::invalid("plan.sigma", problem));
        }
        Ok(Sigma::PerControl(per_control))
    }
}

/// Refuses a count outside of `1..=most`.
fn within(key: &str, value: u32, most: u32) -> Result<()> {
    match (1..=most).contains(&value) {
        true => Ok(()),
        false => Err(Error::invalid(key, format!("{value} is not within 1..={most}"))),
    }
}

/// Refuses a sigma that is not of as many controls.
fn count(what: &str, has: usize, controls: &[Axis]) -> Result<()> {
    if has == controls.len() {
        return Ok(());
    }
    let names: Vec<&str> = controls.iter().map(|axis| axis.name.as_str()).collect();
    let problem = format!(
        "{has} {what}; expected {}, one for each control in order: {}",
        controls.len(),
        names.join(", ")
    );
    Err(Error::invalid("plan.sigma", problem))
}

/// Refuses open bounds, and controls none of which can move.
fn check_bounds(controls: &[Axis]) -> Result<()> {
    if let Some(open) =
        controls.iter().find(|axis| !(axis.low.is_finite() && axis.high.is_finite()))
    {
        let problem = format!(
            "[{}, {}] is open, and samples of plans are drawn around controls within finite bounds: give \
             both ends, for instance bounds = [-10.0, 10.0], and `plan.sigma` where a quarter of that \
             range is not the noise that is meant",
            open.low, open.high
        );
        return Err(Error::invalid(format!("model.controls.{}.bounds", open.name), problem));
    }
    if controls.iter().all(|axis| axis.low == axis.high) {
        let problem = "the bounds of every control have no width, so there is nothing to plan; widen \
                       those of one control at least";
        return Err(Error::invalid("model.controls", problem));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controls(bounds: &[[f32; 2]]) -> Vec<Axis> {
        let axis = |(i, [low, high]): (usize, &[f32; 2])| Axis {
            name: format!("u{i}"),
            unit: String::new(),
            low: *low,
            high: *high,
        };
        bounds.iter().enumerate().map(axis).collect()
    }

    #[test]
    fn noise_is_a_quarter_of_the_range_unless_it_is_given() {
        let two = controls(&[[-1.0, 1.0], [0.0, 20.0]]);
        let sigma = |sigma| {
            let settings = PlanSettings { sigma, ..PlanSettings::default() };
            settings.spec(&two).map(|spec| spec.settings().sigma.clone())
        };
        assert_eq!(sigma(None).unwrap(), Sigma::PerControl(vec![0.5, 5.0]));
        let same = sigma(Some(SigmaSetting::Same(0.3))).unwrap();
        assert_eq!(same, Sigma::PerControl(vec![0.3, 0.3]));
        let wrong = sigma(Some(SigmaSetting::PerControl(vec![1.0; 3]))).unwrap_err().to_string();
        assert!(wrong.contains("3 numbers; expected 2") && wrong.contains("u0, u1"), "{wrong}");
        let none = sigma(Some(SigmaSetting::Same(0.0))).unwrap_err().to_string();
        assert!(none.contains("plan.sigma") && none.contains("nothing is improved"), "{none}");
    }

    #[test]
    fn bounds_that_no_plan_can_use_are_refused_with_the_remedy() {
        let refused = |bounds: &[[f32; 2]]| {
            PlanSettings::default().spec(&controls(bounds)).unwrap_err().to_string()
        };
        let open = refused(&[[-1.0, 1.0], [-2.0, f32::INFINITY]]);
        for words in
            ["model.controls.u1.bounds", "[-2, inf] is open", "plan.sigma", "[-10.0, 10.0]"]
        {
            assert!(open.contains(words), "no `{words}` in: {open}");
        }
        let fixed = refused(&[[1.0, 1.0], [0.0, 0.0]]);
        assert!(fixed.contains("nothing to plan"), "{fixed}");
        // One that stays as it is beside one that moves.
        PlanSettings::default().spec(&controls(&[[1.0, 1.0], [0.0, 1.0]])).unwrap();
    }

    #[test]
    fn counts_are_named_by_their_keys() {
        let one = controls(&[[-1.0, 1.0]]);
        let base = PlanSettings::default();
        let cases = [
            (PlanSettings { runs: 0, ..base.clone() }, "plan.runs: 0"),
            (PlanSettings { runs: 1001, ..base.clone() }, "plan.runs: 1001"),
            (PlanSettings { steps: Some(0), ..base.clone() }, "plan.steps: 0"),
            (PlanSettings { iterations: 0, ..base.clone() }, "plan.iterations: 0"),
            (PlanSettings { samples: 0, ..base.clone() }, "plan.samples: 0"),
            (PlanSettings { horizon: 513, ..base.clone() }, "plan.horizon: 513"),
            (PlanSettings { temperature: 0.0, ..base.clone() }, "plan.temperature: 0"),
        ];
        for (settings, words) in cases {
            let found = settings.spec(&one).unwrap_err().to_string();
            assert!(found.contains(words), "no `{words}` in: {found}");
        }
        PlanSettings { horizon: 1, ..base }.spec(&one).unwrap();
    }
}
