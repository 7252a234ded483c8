//! What is read off a point: the measures that figures show, and what points are compared by.

use crate::race::page::verdicts::{self, Ceiling};
use crate::race::record::JudgedRecord;
use crate::race::sweep::record::{
    CertificatePoint, PointRecord, PointResult, RacePoint, SweepRecord,
};
use crate::report::text::ordinary;

/// A value and the intervals around it, the narrowest first.
pub(super) struct Reading {
    /// The value.
    pub(super) value: f64,
    /// Intervals.
    pub(super) bands: Vec<[f64; 2]>,
}

/// What the scale of a measure covers.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Range {
    /// From 0 to 100.
    Percent,
    /// From 0 to the largest value.
    FromZero,
    /// The values, by their logarithm.
    Log,
    /// The values, by their logarithm if they span more than a decade.
    Fitting,
}

/// Reads one value off a point; none where there is nothing to draw.
pub(super) type Read = fn(&SweepRecord, &PointRecord) -> Option<Reading>;

/// Something that a figure shows of each point.
pub(super) struct Measure {
    /// Anchor of its figure.
    pub(super) id: &'static str,
    /// Title of its figure.
    pub(super) title: &'static str,
    /// Name with unit, beside the axis.
    pub(super) label: &'static str,
    /// What its scale covers.
    pub(super) range: Range,
    /// What its bands are, the narrowest first.
    pub(super) bands: &'static [&'static str],
    /// A sentence on how to read it.
    pub(super) caption: &'static str,
    /// The value of a point.
    pub(super) read: Read,
}

/// Races won.
pub(super) const SUCCESS: Measure = Measure {
    id: "figure-success",
    title: "Races won",
    label: "races won, %",
    range: Range::Percent,
    bands: &["95 % interval of the point"],
    caption: "Mean over the noise seeds; the interval is of the first seed's run and of one point \
              at a time.",
    read: |record, point| {
        let judged = judged(record, point)?;
        reading(100.0 * judged.rate, &[judged.interval.map(|end| 100.0 * end)])
    },
};

/// Compute time of a control step.
pub(super) const LATENCY: Measure = Measure {
    id: "figure-latency",
    title: "Latency of a control step",
    label: "latency, ms",
    range: Range::Log,
    bands: &["median to the 95th percentile", "median to the 99th percentile"],
    caption: "Median compute time of a control step of one race that flies alone.",
    read: |_, point| {
        let latency = &race(point)?.latency;
        let [median, p95, p99] =
            [latency.median_seconds, latency.p95_seconds, latency.p99_seconds].map(|s| 1e3 * s);
        reading(median, &[[median, p95], [median, p99]])
    },
};

/// The certified set's share of the box.
pub(super) const SHARE: Measure = Measure {
    id: "figure-share",
    title: "Certified set",
    label: "share of the box, %",
    range: Range::FromZero,
    bands: &["two-sided interval of the share"],
    caption: "Share of the draws from the box with V_check > 0, with the interval that the \
              certificate states.",
    read: |_, point| {
        let certificate = certificate(point)?;
        let interval = certificate.share_interval.map(|end| 100.0 * end);
        reading(100.0 * share(certificate), &[interval])
    },
};

/// Pairs of the deviation bound.
pub(super) const SCENARIOS: Measure = Measure {
    id: "figure-scenarios",
    title: "Scenarios of the deviation bound",
    label: "pairs N",
    range: Range::Fitting,
    bands: &[],
    caption: "Pairs that the deviation bound was drawn from.",
    read: |_, point| reading(certificate(point)?.deviation_scenarios as f64, &[]),
};

/// Largest deviation bound.
pub(super) const DEVIATION: Measure = Measure {
    id: "figure-deviation",
    title: "Deviation bound",
    label: "largest deviation bound",
    range: Range::FromZero,
    bands: &[],
    caption: "Largest bound over the steps on how far a perturbed rollout strays.",
    read: |_, point| reading(certificate(point)?.deviation_bound, &[]),
};

/// Radius of the verified set.
pub(super) const GROWTH: Measure = Measure {
    id: "figure-growth",
    title: "Local growth",
    label: "radius of the verified set",
    range: Range::FromZero,
    bands: &[],
    caption: "Radius of the ball that local growth verified; 0 where none was.",
    read: |_, point| reading(certificate(point)?.radius, &[]),
};

/// A value that can be drawn, with those of its intervals that can.
fn reading(value: f64, bands: &[[f64; 2]]) -> Option<Reading> {
    let drawable = |band: &&[f64; 2]| band.iter().all(|&end| ordinary(end));
    let bands = bands.iter().filter(drawable).copied().collect();
    ordinary(value).then_some(Reading { value, bands })
}

/// The races of a point.
pub(super) fn race(point: &PointRecord) -> Option<&RacePoint> {
    match &point.result {
        PointResult::Race(race) => Some(race),
        PointResult::Certificate(_) => None,
    }
}

/// The certificate of a point.
pub(super) fn certificate(point: &PointRecord) -> Option<&CertificatePoint> {
    match &point.result {
        PointResult::Race(_) => None,
        PointResult::Certificate(certificate) => Some(certificate),
    }
}

/// What the judge of the sweep said of a point.
pub(super) fn judged<'a>(record: &SweepRecord, point: &'a PointRecord) -> Option<&'a JudgedRecord> {
    let judge = record.judge?;
    race(point)?.judged.iter().find(|judged| judged.judge == judge)
}

/// Share of the draws that the certified set holds; 0 without draws.
pub(super) fn share(certificate: &CertificatePoint) -> f64 {
    certificate.accepted as f64 / certificate.draws.max(1) as f64
}

/// What points are compared by: the success rate, or the certified share.
pub(super) fn score(record: &SweepRecord, point: &PointRecord) -> Option<f64> {
    let score = match &point.result {
        PointResult::Race(_) => judged(record, point)?.rate,
        PointResult::Certificate(certificate) => share(certificate),
    };
    ordinary(score).then_some(score)
}

/// Most races that can be won under the judge of the sweep.
pub(super) fn ceiling(record: &SweepRecord) -> Option<Ceiling> {
    verdicts::ceiling(record.starts.as_ref()?, record.judge?)
}
