//! Tiers over time: which share of the races flies in which tier.

use super::words;
use crate::race::record::{RaceRecord, TierRecord};
use crate::report::figure::{Figure, Swatch};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::sheet::{WIDTH, panels};
use crate::report::span::Span;

/// Tiers and the races that are over, from the bottom of the stack.
const BANDS: [(&str, &str, &str); 5] = [
    ("tier-0", "weave tier-0", "0"),
    ("tier-1", "weave tier-1", "1"),
    ("tier-2", "weave tier-2", "2"),
    ("tier-3", "weave tier-3", "3"),
    ("over", "weave over", "over"),
];
/// Least height of a band, in percent, that holds its label.
const LABELLED: f64 = 11.0;

/// One panel per controller with tiers.
pub(super) fn figure(record: &RaceRecord) -> Figure {
    let tiers = record.controllers.iter().zip(0..).filter_map(|(controller, index)| {
        let tiers = controller.tiers.as_ref()?;
        let drawing = panel(tiers, index, &controller.name)?;
        Some((controller.name.clone(), drawing))
    });
    let drawn: Vec<_> = tiers.collect();
    let legend = BANDS.iter().zip(0..).map(|((band, weave, _), tier)| {
        let area = "M-14-6.5H14V6.5H-14Z";
        let swatch = format!(
            "<path class=\"band {band}\" d=\"{area}\"/><path class=\"{weave}\" d=\"{area}\"/>"
        );
        let name = match tier {
            4 => "race over".to_owned(),
            _ => format!("tier {tier}, {}", words::tier(tier)),
        };
        (Swatch::Mark(swatch), name)
    });
    Figure {
        id: "figure-tiers",
        title: "Tiers over time".to_owned(),
        legend: if drawn.is_empty() { Vec::new() } else { legend.collect() },
        drawing: match drawn.is_empty() {
            true => Err("No controller has tiers.".to_owned()),
            false => Ok(panels(&drawn)),
        },
        caption: "Share of all races, over all noise seeds, in each tier at each control step."
            .to_owned(),
    }
}

/// The stacked areas; `None` without a step.
fn panel(tiers: &TierRecord, index: usize, name: &str) -> Option<String> {
    if tiers.occupancy.is_empty() {
        return None;
    }
    let steps = Span { low: 0.0, high: tiers.occupancy.len() as f64 };
    let share = Span { low: 0.0, high: 100.0 };
    let id = format!("tiers-{index}");
    let mut plot = Plot::across_width(&id, steps, share, Proportions::Free(190.0), WIDTH);
    for (number, (band, weave, label)) in BANDS.iter().enumerate() {
        let edges: Vec<[f64; 2]> =
            tiers.occupancy.iter().map(|counts| edges(counts, number)).collect();
        if edges.iter().all(|[low, high]| low == high) {
            continue;
        }
        let data = outline(&plot, &edges);
        plot.path(&format!("band {band}"), &data);
        plot.path(weave, &data);
        if let Some(place) = place(&edges) {
            let text =
                format!("<text class=\"letter\" text-anchor=\"middle\" y=\"4.5\">{label}</text>");
            plot.mark(place, &text);
        }
    }
    let labels = Labels { x: "control step", y: "share of races, %", whole: true };
    Some(plot.finish(&labels, &format!("Tiers of {name} over the control steps")))
}

/// Lower and upper edge of a band, percent.
fn edges(counts: &[u64; 5], band: usize) -> [f64; 2] {
    let sum = |bands: usize| counts[..bands].iter().map(|&count| count as f64).sum::<f64>();
    let total = sum(counts.len()).max(1.0);
    [100.0 * sum(band) / total, 100.0 * sum(band + 1) / total]
}

/// The band as a polygon: each step holds for its whole width.
fn outline(plot: &Plot, edges: &[[f64; 2]]) -> String {
    let side = |side: usize| {
        let steps = edges.iter().enumerate();
        steps.flat_map(move |(step, edges)| {
            [[step as f64, edges[side]], [step as f64 + 1.0, edges[side]]]
        })
    };
    let mut back: Vec<_> = side(0).collect();
    back.reverse();
    plot.polygon(side(1).chain(back))
}

/// The middle of the band where it is thickest, if a label fits there.
fn place(edges: &[[f64; 2]]) -> Option<[f64; 2]> {
    // A label at either end would stand across the frame.
    let inner = edges.len() / 20 + 1;
    let steps = edges.iter().enumerate().skip(inner).take(edges.len().saturating_sub(2 * inner));
    let (step, [low, high]) =
        steps.max_by(|(_, a), (_, b)| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    (high - low >= LABELLED).then_some([step as f64 + 0.5, (low + high) / 2.0])
}
