//! The table of the deterministic certificate.

use super::table::pairs;
use super::text::{count, interval, lower, upper};
use super::words;
use crate::scenario::record::Record;

/// Numbers and modes of the deterministic certificate; nothing where there is none.
pub(crate) fn table(record: &Record) -> String {
    let Some(found) = &record.deterministic else { return String::new() };
    let [low, high] = found.share_interval;
    let radii = &found.radii;
    let quantiles: Vec<String> = radii.quantiles.iter().map(|radius| lower(*radius)).collect();
    pairs(
        "Deterministic certificate",
        &[
            ("enclosure", found.kind.name().to_owned()),
            ("perturbed trajectories", words::control(found.control).to_owned()),
            ("radius of the ball", upper(found.radius)),
            ("starts drawn from the box", count(found.starts)),
            ("of which a rollout succeeds", count(found.reached)),
            ("of which the whole ball is certified", count(found.certified)),
            ("share of the box", interval([low, high])),
            ("one minus confidence of the share", upper(found.beta)),
            ("starts whose radius was looked for", count(radii.starts)),
            ("largest radius looked for", lower(radii.most)),
            ("radius at 10, 50, 90 % of them", quantiles.join(", ")),
            ("f32 rollouts from the enclosure, at most", upper(found.f32_distance)),
        ],
    )
}
