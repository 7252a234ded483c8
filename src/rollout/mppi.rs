//! Checked settings of plans, with what the kernels need of them.

use nalgebra::{DMatrix, DVector};

use super::mppi_settings::{MAX_PLAN, MAX_SAMPLES, MppiSettings, Sigma};
use super::noise::Noise;
use crate::error::{Error, Result};

/// Checked settings, with what the kernels need of them.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiSpec {
    settings: MppiSettings,
    noise: Noise,
    /// `lambda Sigma^-1`, row by row, where noise costs.
    penalty: Option<Vec<f32>>,
}

impl MppiSpec {
    /// Checks `settings`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting: samples or horizon out of range, a temperature that
    /// is not positive, no control, a sigma of another number of controls, negative or not positive
    /// definite, crossed bounds, a correlation time that is not positive, no knot or more knots than
    /// steps, noise cost with noise that is not independent.
    pub fn new(settings: MppiSettings) -> Result<Self> {
        check_sizes(&settings)?;
        check_bounds(&settings.bounds)?;
        let factor = cholesky(&settings.sigma)?;
        let penalty = settings.noise_cost.then(|| penalty(&factor, settings.temperature));
        let noise = Noise::new(&settings, row_major(&factor))?;
        Ok(Self { settings, noise, penalty: penalty.transpose()? })
    }

    /// The settings.
    pub fn settings(&self) -> &MppiSettings {
        &self.settings
    }

    /// Number of controls.
    pub fn controls(&self) -> usize {
        self.settings.bounds.len()
    }

    /// Steps of a plan.
    pub fn horizon(&self) -> usize {
        self.settings.horizon as usize
    }

    /// The noise of the samples.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// `lambda Sigma^-1`, row by row, `[controls, controls]`, where noise costs.
    pub fn penalty(&self) -> Option<&[f32]> {
        self.penalty.as_deref()
    }
}

/// # Errors
/// [`Error::Invalid`] for samples, a horizon or a temperature out of range.
fn check_sizes(settings: &MppiSettings) -> Result<()> {
    let within = |name: &str, value: u32, most: u32| match value {
        value if (1..=most).contains(&value) => Ok(()),
        value => Err(Error::invalid(name, format!("{value} is not within 1..={most}"))),
    };
    within("samples", settings.samples, MAX_SAMPLES)?;
    within("horizon", settings.horizon, MAX_PLAN)?;
    if settings.temperature > 0.0 && settings.temperature.is_finite() {
        return Ok(());
    }
    let problem = format!("{} is not a positive number", settings.temperature);
    Err(Error::invalid("temperature", problem))
}

/// # Errors
/// [`Error::Invalid`] for no control, and for crossed or infinite bounds.
fn check_bounds(bounds: &[[f32; 2]]) -> Result<()> {
    if bounds.is_empty() {
        return Err(Error::invalid("bounds", "none given; a plan is of one control at least"));
    }
    for (i, &[low, high]) in bounds.iter().enumerate() {
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
    Ok(())
}

/// The lower triangular `L` with `L L' = Sigma`.
fn cholesky(sigma: &Sigma) -> Result<DMatrix<f64>> {
    match sigma {
        Sigma::PerControl(deviations) => {
            for (i, &deviation) in deviations.iter().enumerate() {
                if !(deviation >= 0.0 && deviation.is_finite()) {
                    let problem = format!("control {i} has {deviation}; expected 0 or more");
                    return Err(Error::invalid("sigma", problem));
                }
            }
            let diagonal = deviations.iter().copied().map(f64::from);
            Ok(DMatrix::from_diagonal(&DVector::from_iterator(deviations.len(), diagonal)))
        }
        Sigma::Covariance(rows) => {
            let square = rows.iter().all(|row| row.len() == rows.len());
            let matrix = square.then(|| {
                DMatrix::<f64>::from_fn(rows.len(), rows.len(), |i, j| f64::from(rows[i][j]))
            });
            let symmetric = matrix
                .filter(|matrix| (matrix - matrix.transpose()).amax() <= 1e-6 * matrix.amax());
            let found = symmetric.and_then(nalgebra::Cholesky::new);
            found.map(|found| found.l()).ok_or_else(|| {
                let problem = "the covariance is not symmetric and positive definite";
                Error::invalid("sigma", problem)
            })
        }
    }
}

/// The entries of `matrix` row by row, rounded to f32.
fn row_major(matrix: &DMatrix<f64>) -> Vec<f32> {
    matrix.transpose().iter().map(|&entry| entry as f32).collect()
}

/// `lambda Sigma^-1` from the factor of Sigma; every control must have noise.
fn penalty(factor: &DMatrix<f64>, temperature: f32) -> Result<Vec<f32>> {
    // The factor that the samples are scaled by is the one that counts.
    let lower = factor.map(|entry| f64::from(entry as f32));
    let inverse = (&lower * lower.transpose()).try_inverse().ok_or_else(|| {
        Error::invalid("noise_cost", "a control without noise has no noise cost; set its sigma")
    })?;
    let penalty = row_major(&(inverse * f64::from(temperature)));
    if penalty.iter().all(|entry| entry.is_finite()) {
        return Ok(penalty);
    }
    Err(Error::invalid("noise_cost", "sigma is so small that the noise cost overflows"))
}
