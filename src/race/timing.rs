//! Compute times of controllers.

use serde::Serialize;

use super::controller::Name;

/// Compute time of a controller: the races of a batch step together, so a time is that of the batch
/// divided by the races under way, not the latency of a step.
#[derive(Clone, Debug, Serialize)]
pub struct TimingRecord {
    /// The controller.
    pub name: String,
    /// Control steps, over all races and seeds.
    pub steps: u64,
    /// Mean share of a race in the wall time of a step, s.
    #[serde(with = "crate::files::number")]
    pub mean_seconds: f64,
    /// The share that 99 % of the steps stay below, s.
    #[serde(with = "crate::files::number")]
    pub p99_seconds: f64,
    /// The largest share, s.
    #[serde(with = "crate::files::number")]
    pub most_seconds: f64,
}

impl TimingRecord {
    /// From the compute time of each step of the controller `name`, s.
    pub(super) fn new(name: Name, mut sorted: Vec<f32>) -> Self {
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| quantile(&sorted, share);
        Self {
            name: name.text().to_owned(),
            steps: sorted.len() as u64,
            mean_seconds: mean_seconds(&sorted),
            p99_seconds: at(0.99),
            most_seconds: at(1.0),
        }
    }
}

/// Mean of compute times; 0 without any.
pub(super) fn mean_seconds(seconds: &[f32]) -> f64 {
    seconds.iter().map(|s| f64::from(*s)).sum::<f64>() / seconds.len().max(1) as f64
}

/// The number that `share` of `sorted` stays below; 0 without any.
pub(super) fn quantile(sorted: &[f32], share: f64) -> f64 {
    let place = (share * sorted.len() as f64) as usize;
    sorted.get(place.min(sorted.len().saturating_sub(1))).map_or(0.0, |s| f64::from(*s))
}
