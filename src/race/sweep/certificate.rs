//! A point of a sweep as a certificate.

use super::record::{AxisRecord, CertificatePoint, SWEEP_SCHEMA, SweepRecord};
use crate::backend::Program;
use crate::digest;
use crate::error::Result;
use crate::race::run::program_sha256;
use crate::scenario::settings::Settings;
use crate::scenario::{self, Watch, provenance};

/// A sweep of certificates over `axes` with `total` points, none of which is done; `config` is what
/// every point starts from.
pub fn certificate_sweep(
    program: &Program<'_>,
    seed: u64,
    config: serde_json::Value,
    axes: Vec<AxisRecord>,
    total: u64,
) -> SweepRecord {
    SweepRecord {
        schema: SWEEP_SCHEMA,
        provenance: provenance(program, seed, config),
        starts: None,
        noise_seeds: Vec::new(),
        judge: None,
        axes,
        total,
        points: Vec::new(),
        notes: Vec::new(),
    }
}

/// SHA-256 over everything that a certificate depends on.
pub fn certificate_sha256(program: &Program<'_>, seed: u64, config: serde_json::Value) -> String {
    let point = serde_json::json!({
        "program_sha256": program_sha256(),
        "provenance": provenance(program, seed, config),
    });
    digest::sha256([point.to_string().as_bytes()])
}

/// Certifies the plant and keeps the figures that a sweep compares.
///
/// # Errors
/// Those of [`scenario::certify`].
pub fn certificate_point(
    program: &Program<'_>,
    settings: &Settings,
    config: serde_json::Value,
    watch: &dyn Watch,
) -> Result<CertificatePoint> {
    let record = scenario::certify(program, settings, config, watch)?;
    let (deviation, global, growth) = (&record.deviation, &record.global, &record.growth);
    Ok(CertificatePoint {
        deviation_scenarios: deviation.claim.scenarios,
        deviation_risk: deviation.claim.certified_risk,
        deviation_bound: deviation.bound.iter().copied().fold(0.0, f64::max),
        draws: global.share.map_or(global.draws, |share| share.draws),
        accepted: global.share.map_or(global.accepted, |share| share.inside),
        share_interval: global.share_interval,
        volume_interval: global.volume_interval,
        conditional_risk: global.claim.certified_risk,
        growth_scenarios: settings.growth.scenarios,
        growth: growth.outcome,
        rounds: growth.rounds.len() as u64,
        radius: growth.radius,
        holds: record.holds,
        beta_total: record.beta_total,
        seconds: record.timing.wall_seconds,
    })
}
