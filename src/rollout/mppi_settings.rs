//! What plans are improved with: samples, horizon, temperature, noise; `docs/method.md` section 7.

use crate::system::Axis;

/// Most samples of a problem.
pub const MAX_SAMPLES: u32 = 1_000_000;
/// Longest plan, steps.
pub const MAX_PLAN: u32 = 512;

/// Standard deviation of the control noise.
#[derive(Clone, Debug, PartialEq)]
pub enum Sigma {
    /// Of each control, `[controls]`, independent of each other.
    PerControl(Vec<f32>),
    /// The whole covariance matrix, row by row, `[controls, controls]`.
    Covariance(Vec<Vec<f32>>),
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
#[derive(Clone, Debug, PartialEq)]
pub struct MppiSettings {
    /// Samples K of each problem, `1..=10^6`.
    pub samples: u32,
    /// Steps H of a plan, `1..=512`.
    pub horizon: u32,
    /// Temperature lambda of the weights, in units of cost.
    pub temperature: f32,
    /// Size of the noise.
    pub sigma: Sigma,
    /// How it hangs together over the steps.
    pub noise: NoiseKind,
    /// Whether sample `2 m + 1` takes the noise of sample `2 m` with the opposite sign.
    pub antithetic: bool,
    /// Whether each sample pays `lambda u_t' Sigma^-1 e_t`, with `u` the nominal plan and `e` the
    /// noise after clipping; for independent noise only.
    pub noise_cost: bool,
    /// Bounds of each control, `[controls]`.
    pub bounds: Vec<[f32; 2]>,
}

impl MppiSettings {
    /// K samples of H steps within the bounds of `controls`: temperature 1, sigma a quarter of each
    /// control's range, independent noise, no noise cost.
    pub fn new(controls: &[Axis], samples: u32, horizon: u32) -> Self {
        let bounds: Vec<[f32; 2]> = controls.iter().map(|axis| [axis.low, axis.high]).collect();
        let quarters = bounds.iter().map(|[low, high]| 0.25 * (high - low)).collect();
        Self {
            samples,
            horizon,
            temperature: 1.0,
            sigma: Sigma::PerControl(quarters),
            noise: NoiseKind::Independent,
            antithetic: false,
            noise_cost: false,
            bounds,
        }
    }
}
