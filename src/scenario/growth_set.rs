//! The nested sets of a growth around their centre, and a round of starts in one of them.

use super::Context;
use super::growth_plan::{GrowthShape, UpwardRecord};
use super::record::{RoundRecord, SampleRecord, decimal};
use super::settings::Settings;
use super::walk::Walk;
use crate::error::Result;
use crate::rollout::{Ball, Ellipsoid, NON_FINITE, Region, Starts, Stream};

/// Starts of a round that are kept for the picture.
const KEPT_SAMPLES: u64 = 400;

/// Sets around a centre, one for each radius, each inside the larger ones.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Family {
    /// What they are.
    pub(super) shape: GrowthShape,
    /// Centre; also the value of the frozen coordinates.
    pub(super) center: Vec<f32>,
    /// Half-width of each coordinate at radius 1; 0 freezes it.
    pub(super) widths: Vec<f32>,
}

impl Family {
    /// Balls in the coordinates that vary.
    pub(super) fn balls(center: Vec<f32>, varies: &[bool]) -> Self {
        let widths = varies.iter().map(|varies| f32::from(u8::from(*varies))).collect();
        Self { shape: GrowthShape::Ball, center, widths }
    }

    /// The set of that radius.
    pub(super) fn at(&self, radius: f32) -> Region {
        let halves = || self.widths.iter().map(|width| radius * width);
        let corner = |side: f32| {
            let ends = self.center.iter().zip(halves());
            ends.map(|(center, half)| center + side * half).collect()
        };
        match self.shape {
            GrowthShape::Ball => Region::Ball(Ball {
                center: self.center.clone(),
                radius,
                varies: self.widths.iter().map(|width| *width > 0.0).collect(),
            }),
            GrowthShape::Ellipsoid => Region::Ellipsoid(Ellipsoid {
                center: self.center.clone(),
                half_axes: halves().collect(),
            }),
            GrowthShape::Box => Region::Box { low: corner(-1.0), high: corner(1.0) },
        }
    }

    /// The radius of the smallest set that reaches `x` in the coordinates that vary.
    pub(super) fn radius_of(&self, x: &[f32]) -> f64 {
        let varying = (0..x.len()).filter(|&i| self.widths[i] > 0.0);
        let scaled = varying
            .map(|i| (f64::from(x[i]) - f64::from(self.center[i])) / f64::from(self.widths[i]));
        match self.shape {
            GrowthShape::Box => scaled.fold(0.0, |most, offset| most.max(offset.abs())),
            _ => scaled.map(|offset| offset.powi(2)).sum::<f64>().sqrt(),
        }
    }
}

impl UpwardRecord {
    /// The sets around `center`.
    pub(super) fn family(&self, center: Vec<f32>) -> Family {
        Family { shape: self.shape, center, widths: self.widths.clone() }
    }
}

/// What a round draws.
#[derive(Clone, Copy)]
pub(super) struct Drawn {
    pub(super) stream: Stream,
    /// Starts.
    pub(super) count: u64,
    /// The first of them that are kept.
    pub(super) kept: u64,
}

impl Drawn {
    /// `count` starts of `stream`, of which some are kept for the picture.
    pub(super) fn pictured(stream: Stream, count: u64) -> Self {
        Self { stream, count, kept: KEPT_SAMPLES }
    }
}

/// What one round showed.
pub(super) struct Round {
    pub(super) record: RoundRecord,
    pub(super) samples: Vec<SampleRecord>,
}

/// One round: fresh starts in the set of that radius, their outcomes, and the nearest failure.
pub(super) fn round(
    context: Context<'_>,
    settings: &Settings,
    family: &Family,
    radius: f32,
    Drawn { stream, count, kept }: Drawn,
    band: f64,
) -> Result<Round> {
    let starts = Starts::Drawn { region: family.at(radius), stream };
    let spec = settings.spec;
    let mut record = RoundRecord {
        radius: decimal(radius),
        scenarios: count,
        failures: 0,
        nearest_failure: None,
        non_finite: 0,
        f64_reruns: 0,
    };
    let mut samples = Vec::new();
    Walk { starts: starts.clone(), range: 0..count, spec, band }.each(context, |rolled| {
        let start = starts.start(rolled.index);
        record.f64_reruns += rolled.reruns();
        if rolled.failed() {
            record.failures += 1;
            record.non_finite += u64::from(rolled.measure == f64::from(NON_FINITE));
            let distance = family.radius_of(&start);
            let nearest = record.nearest_failure.map_or(distance, |n| n.min(distance));
            record.nearest_failure = Some(nearest);
        }
        if rolled.index < kept {
            samples.push(SampleRecord { x: start, success: !rolled.failed() });
        }
    })?;
    Ok(Round { record, samples })
}
