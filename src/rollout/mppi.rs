//! What a batch of MPPI problems is: settings, problems, results; `docs/method.md` section 7.

use nalgebra::DMatrix;

use super::noise::Noise;
use super::sample::Stream;
use crate::error::{Error, Result};
use crate::policy::Mlp;
use crate::system::System;

/// Most samples of a problem.
pub const MAX_SAMPLES: u32 = 1_000_000;
/// Longest plan, steps.
pub const MAX_PLAN: u32 = 512;

/// Standard deviation of the control noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sigma<const NU: usize> {
    /// Of each control, independent of each other.
    PerControl([f32; NU]),
    /// The whole covariance matrix, row by row.
    Covariance([[f32; NU]; NU]),
}

/// How the noise of a sample hangs together over the steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum NoiseKind {
    /// Independent at each step.
    #[default]
    Independent,
    /// Stationary autoregression of order one: correlation `exp(-1 / time)` between neighbours.
    Colored {
        /// Correlation time, steps.
        time: f32,
    },
    /// A cubic through independent knots, equally spaced over the plan, scaled to the same
    /// variance at each step.
    Spline {
        /// Number of knots.
        knots: u32,
    },
}

/// What a plan is improved with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MppiSettings<const NU: usize> {
    /// Samples K of each problem, `1..=10^6`.
    pub samples: u32,
    /// Steps H of a plan, `1..=512`.
    pub horizon: u32,
    /// Temperature lambda of the weights, in units of cost.
    pub temperature: f32,
    /// Size of the noise.
    pub sigma: Sigma<NU>,
    /// How it hangs together over the steps.
    pub noise: NoiseKind,
    /// Whether sample `2 m + 1` takes the noise of sample `2 m` with the opposite sign.
    pub antithetic: bool,
    /// Whether each sample pays `lambda u_t' Sigma^-1 e_t`, with `u` the nominal plan and `e` the
    /// noise after clipping; for independent noise only.
    pub noise_cost: bool,
    /// Bounds of each control.
    pub bounds: [[f32; 2]; NU],
}

impl<const NU: usize> MppiSettings<NU> {
    /// K samples of H steps within the bounds of `system`: temperature 1, sigma a quarter of each
    /// control's range, independent noise, no noise cost.
    pub fn new<S, const NX: usize>(system: &S, samples: u32, horizon: u32) -> Self
    where
        S: System<NX, NU>,
    {
        let bounds = system.controls().map(|axis| [axis.low, axis.high]);
        Self {
            samples,
            horizon,
            temperature: 1.0,
            sigma: Sigma::PerControl(bounds.map(|[low, high]| 0.25 * (high - low))),
            noise: NoiseKind::Independent,
            antithetic: false,
            noise_cost: false,
            bounds,
        }
    }
}

/// Checked settings, with what the kernels need of them.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiSpec<const NU: usize> {
    settings: MppiSettings<NU>,
    noise: Noise<NU>,
    /// `lambda Sigma^-1`, where noise costs.
    penalty: Option<[[f32; NU]; NU]>,
}

impl<const NU: usize> MppiSpec<NU> {
    /// Checks `settings`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting: samples or horizon out of range, a temperature that
    /// is not positive, a sigma that is negative or not positive definite, crossed bounds, a
    /// correlation time that is not positive, no knot or more knots than steps, noise cost with
    /// noise that is not independent.
    pub fn new(settings: MppiSettings<NU>) -> Result<Self> {
        let within = |name: &str, value: u32, most: u32| match value {
            value if (1..=most).contains(&value) => Ok(()),
            value => Err(Error::invalid(name, format!("{value} is not within 1..={most}"))),
        };
        within("samples", settings.samples, MAX_SAMPLES)?;
        within("horizon", settings.horizon, MAX_PLAN)?;
        if !(settings.temperature > 0.0 && settings.temperature.is_finite()) {
            let problem = format!("{} is not a positive number", settings.temperature);
            return Err(Error::invalid("temperature", problem));
        }
        for (i, [low, high]) in settings.bounds.into_iter().enumerate() {
            // No width is a control that stays as it is.
            if !(low <= high && low.is_finite() && high.is_finite()) {
                let what = match low.is_finite() && high.is_finite() {
                    true => "the empty interval",
                    false => "an end that is not finite in",
                };
                let problem = format!("control {i} has {what} [{low}, {high}]");
                return Err(Error::invalid("bounds", problem));
            }
        }
        let factor = cholesky(&settings.sigma)?;
        let noise = Noise::new(&settings, factor)?;
        let penalty = settings.noise_cost.then(|| penalty(&factor, settings.temperature));
        Ok(Self { settings, noise, penalty: penalty.transpose()? })
    }

    /// The settings.
    pub fn settings(&self) -> &MppiSettings<NU> {
        &self.settings
    }

    /// The noise of the samples.
    pub fn noise(&self) -> &Noise<NU> {
        &self.noise
    }

    /// `lambda Sigma^-1`, where noise costs.
    pub fn penalty(&self) -> Option<&[[f32; NU]; NU]> {
        self.penalty.as_ref()
    }
}

/// The lower triangular `L` with `L L' = Sigma`.
fn cholesky<const NU: usize>(sigma: &Sigma<NU>) -> Result<[[f32; NU]; NU]> {
    let mut factor = [[0.0_f32; NU]; NU];
    match sigma {
        Sigma::PerControl(deviations) => {
            for (i, &deviation) in deviations.iter().enumerate() {
                if !(deviation >= 0.0 && deviation.is_finite()) {
                    let problem = format!("control {i} has {deviation}; expected 0 or more");
                    return Err(Error::invalid("sigma", problem));
                }
                factor[i][i] = deviation;
            }
        }
        Sigma::Covariance(matrix) => {
            let entry = |i: usize, j: usize| f64::from(matrix[i][j]);
            let matrix = DMatrix::<f64>::from_fn(NU, NU, entry);
            let symmetric = (&matrix - matrix.transpose()).amax() <= 1e-6 * matrix.amax();
            let found = symmetric.then(|| nalgebra::Cholesky::new(matrix)).flatten();
            let lower = found.ok_or_else(|| {
                let problem = "the covariance is not symmetric and positive definite";
                Error::invalid("sigma", problem)
            })?;
            for (i, row) in factor.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate().take(i + 1) {
                    *entry = lower.l_dirty()[(i, j)] as f32;
                }
            }
        }
    }
    Ok(factor)
}

/// `lambda Sigma^-1` from the factor of Sigma; every control must have noise.
fn penalty<const NU: usize>(factor: &[[f32; NU]; NU], temperature: f32) -> Result<[[f32; NU]; NU]> {
    let lower = DMatrix::<f64>::from_fn(NU, NU, |i, j| f64::from(factor[i][j]));
    let inverse = (&lower * lower.transpose()).try_inverse().ok_or_else(|| {
        Error::invalid("noise_cost", "a control without noise has no noise cost; set its sigma")
    })?;
    let scaled = inverse * f64::from(temperature);
    let penalty: [[f32; NU]; NU] =
        std::array::from_fn(|i| std::array::from_fn(|j| scaled[(i, j)] as f32));
    if penalty.iter().flatten().all(|entry| entry.is_finite()) {
        return Ok(penalty);
    }
    Err(Error::invalid("noise_cost", "sigma is so small that the noise cost overflows"))
}

/// One plan to improve.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiProblem<const NX: usize, const NU: usize, const NC: usize> {
    /// Where the plan starts.
    pub start: [f32; NX],
    /// The nominal plan U, `[H]`.
    pub plan: Vec<[f32; NU]>,
    /// What the cost wants to know at each stage, `[H]`.
    pub context: Vec<[f32; NC]>,
    /// Stream of the noise: sample `k` has index `k` in it.
    pub stream: Stream,
}

/// A penalty on the value of a network along a rollout: `weight max(0, threshold - Q(x_t))^2` at
/// each stage.
#[derive(Clone, Copy, Debug)]
pub struct ValueTerm<'a> {
    /// `Q`: one output for all states.
    pub network: &'a Mlp,
    /// Weight.
    pub weight: f32,
    /// Value below which it costs.
    pub threshold: f32,
}

/// A network that pushes the state at each step: `x_{t+1} = f(x_t, u_t) + sum_j scale_j d_j(x_t)`
/// on the coordinates named, as the disturbance of the study does on the opponent's velocities.
#[derive(Clone, Copy, Debug)]
pub struct Disturbance<'a> {
    /// `d`: as many outputs as there are entries.
    pub network: &'a Mlp,
    /// Coordinate and scale of each output.
    pub entries: &'a [(usize, f32)],
}

/// Problems that are improved together, all with the same settings.
#[derive(Clone, Copy, Debug)]
pub struct MppiTask<'a, const NX: usize, const NU: usize, const NC: usize> {
    /// The settings.
    pub spec: &'a MppiSpec<NU>,
    /// The problems.
    pub problems: &'a [MppiProblem<NX, NU, NC>],
    /// Number of the iteration: each has noise of its own.
    pub iteration: u32,
    /// Penalty on the value along the rollouts.
    pub value: Option<ValueTerm<'a>>,
    /// Disturbance of the rollouts.
    pub disturbance: Option<Disturbance<'a>>,
    /// Whether the cost of every sample is wanted.
    pub costs: CostQuery,
}

/// Whether the cost of every sample is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostQuery {
    /// Only what the plan needs.
    Summary,
    /// All of them: K numbers for each problem.
    Each,
}

/// An improved plan.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiResult<const NU: usize> {
    /// The weighted mean of the samples' controls, `[H]`; the nominal plan, clipped, where no
    /// sample has a finite cost.
    pub plan: Vec<[f32; NU]>,
    /// Smallest cost; infinite where none is finite.
    pub least_cost: f32,
    /// Mean of the finite costs.
    pub mean_cost: f64,
    /// `1 / sum w^2`, from 1 to K; 0 where no cost is finite.
    pub effective_samples: f64,
    /// The sample of the smallest cost, the first of equal ones.
    pub best: u32,
    /// Samples whose cost is not finite: their weight is 0.
    pub non_finite: u32,
    /// The cost of each sample, if asked for; infinite where it is not finite.
    pub costs: Vec<f32>,
}

impl<const NU: usize> MppiResult<NU> {
    /// The weight of each sample, `[K]`; empty unless the costs were asked for.
    pub fn weights(&self, temperature: f32) -> Vec<f64> {
        let excess = |cost: f32| f64::from(cost) - f64::from(self.least_cost);
        let raw = |cost: &f32| match cost.is_finite() {
            true => (-excess(*cost) / f64::from(temperature)).exp(),
            false => 0.0,
        };
        let raw: Vec<f64> = self.costs.iter().map(raw).collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
    }
}

impl<const NX: usize, const NU: usize, const NC: usize> MppiTask<'_, NX, NU, NC> {
    /// Refuses a task whose parts do not fit each other.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a plan or context that has not H steps, a start or plan that is not
    /// finite, a network of the wrong shape, or a weight, threshold or scale that is not finite.
    pub fn check(&self) -> Result<()> {
        let horizon = self.spec.settings.horizon as usize;
        for (number, problem) in self.problems.iter().enumerate() {
            let lengths = [("plan", problem.plan.len()), ("context", problem.context.len())];
            for (name, length) in lengths {
                if length != horizon {
                    let text = format!("problem {number} has {length} steps, expected {horizon}");
                    return Err(Error::invalid(name, text));
                }
            }
            let numbers = problem.start.iter().chain(problem.plan.iter().flatten());
            if !numbers.chain(problem.context.iter().flatten()).all(|number| number.is_finite()) {
                let text = format!("problem {number} has a number that is not finite");
                return Err(Error::invalid("start, plan and context", text));
            }
        }
        let fits = |name: &str, network: &Mlp, outputs: usize| {
            let names: Vec<String> = (0..NX).map(|i| i.to_string()).collect();
            let widths = network.widths();
            if (widths[0], widths[widths.len() - 1]) == (names.len(), outputs) {
                return Ok(());
            }
            let (inputs, has) = (widths[0], widths[widths.len() - 1]);
            let text =
                format!("maps {inputs} inputs to {has} outputs; {NX} and {outputs} are needed");
            Err(Error::invalid(name, text))
        };
        if let Some(value) = &self.value {
            fits("value network", value.network, 1)?;
            if !(value.weight.is_finite() && value.threshold.is_finite()) {
                let text = "weight and threshold of the value term have to be finite";
                return Err(Error::invalid("value network", text));
            }
        }
        if let Some(disturbance) = &self.disturbance {
            let entries = disturbance.entries;
            fits("disturbance network", disturbance.network, entries.len())?;
            if entries.len() > NX || entries.iter().any(|(state, _)| *state >= NX) {
                let text = format!("its outputs go to states below {NX}, at most one for each");
                return Err(Error::invalid("disturbance network", text));
            }
            if !entries.iter().all(|(_, scale)| scale.is_finite()) {
                let text = "the scale of each output has to be finite";
                return Err(Error::invalid("disturbance network", text));
            }
        }
        Ok(())
    }

    /// The controls of a sample of a problem, `[H]`: the plan, its noise added, clipped.
    ///
    /// # Panics
    /// If there is no such problem.
    pub fn controls(&self, problem: usize, sample: u32) -> Vec<[f32; NU]> {
        let MppiProblem { plan, stream, .. } = &self.problems[problem];
        let noise = self.spec.noise.sample(*stream, self.iteration, sample);
        let clipped =
            |u: f32, e: f32, [low, high]: [f32; 2]| crate::real::Real::clamp(u + e, low, high);
        let bounds = &self.spec.settings.bounds;
        let step = |(u, e): (&[f32; NU], &[f32; NU])| {
            std::array::from_fn(|i| clipped(u[i], e[i], bounds[i]))
        };
        plan.iter().zip(&noise).map(step).collect()
    }

    /// The states of a sample of a problem without disturbance, `[H + 1]`.
    ///
    /// # Panics
    /// If there is no such problem.
    pub fn states<S>(&self, system: &S, problem: usize, sample: u32) -> Vec<[f32; NX]>
    where
        S: System<NX, NU>,
    {
        let mut states = vec![self.problems[problem].start];
        for u in self.controls(problem, sample) {
            states.push(system.step(states[states.len() - 1], u));
        }
        states
    }
}
