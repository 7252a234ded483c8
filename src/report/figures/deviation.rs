//! The deviation bound against the step.

use crate::report::figure::{Figure, Swatch};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::span::Span;
use crate::report::text::{lower, ordinary, upper};
use crate::report::words;
use crate::scenario::record::Record;
use crate::scenario::settings::DeviationSource;

const SEEN: &str = "<circle class=\"seen\" r=\"2.4\"/>";

/// Bound used, largest distance seen and, where known, the exact supremum.
pub(super) fn figure(record: &Record) -> Figure {
    let deviation = &record.deviation;
    let used = format!("bound used: {}", words::source(deviation.source));
    let mut legend = vec![
        (Swatch::Line("bound"), used),
        (
            Swatch::Marked("seen-line", SEEN.to_owned()),
            format!("largest distance among {} pairs", deviation.claim.scenarios),
        ),
    ];
    if deviation.exact.is_some() {
        let name = "exact supremum over the ball (linear system)".to_owned();
        legend.push((Swatch::Line("exact"), name));
    }
    Figure {
        id: "figure-deviation",
        title: "How far a perturbed rollout drifts".to_owned(),
        drawing: drawing(record),
        legend,
        caption: caption(record),
    }
}

fn caption(record: &Record) -> String {
    let deviation = &record.deviation;
    let mut caption = format!(
        "Euclidean distance over all {} states between a rollout and one that starts within {} \
         of it; {}. Joint over the steps: {}.",
        record.system.states.len(),
        lower(deviation.radius),
        words::control(deviation.control),
        words::joint(deviation.joint)
    );
    if deviation.source == DeviationSource::Exact {
        caption += " The exact supremum is the bound used, so the two lines coincide.";
    }
    if let Some(step) = deviation.bound.iter().position(|&bound| !ordinary(bound)) {
        caption += &format!(" From step {step} on the bound is not finite.");
    }
    caption
}

fn drawing(record: &Record) -> Result<String, String> {
    let deviation = &record.deviation;
    let exact = deviation.exact.as_deref().unwrap_or_default();
    let all = [&deviation.bound[..], &deviation.largest[..], exact];
    let distances = all.iter().flat_map(|series| series.iter().copied());
    let highest = Span::of(distances.chain([0.0])).ok_or("No bound is finite.")?;
    let steps = Span {
        low: 0.0,
        high: all.iter().map(|series| series.len()).max().unwrap_or(1).max(2) as f64 - 1.0,
    };
    let room = Span { low: 0.0, high: if highest.high > 0.0 { 1.06 * highest.high } else { 1.0 } };
    let mut plot = Plot::new("deviation", steps, room, Proportions::Free(250.0));
    let classes = ["bound", "seen-line", "exact"];
    for (class, series) in classes.into_iter().zip(all) {
        let points = (0..).zip(series).map(|(step, &distance)| [f64::from(step), distance]);
        let line = plot.line(points);
        plot.path(class, &line);
    }
    for step in 0..all.iter().map(|series| series.len()).max().unwrap_or(0) {
        if let Some(&seen) = deviation.largest.get(step) {
            let title = format!("<title>{}</title>{SEEN}", values(record, step));
            plot.mark([step as f64, seen], &title);
        }
    }
    let unit = words::norm_unit(record, |_| true);
    let labels = Labels { x: "step t", y: &format!("distance Δ_t ({unit})"), whole: true };
    Ok(plot.finish(&labels, &description(record)))
}

/// The numbers at a step, shown where the pointer rests.
fn values(record: &Record, step: usize) -> String {
    let deviation = &record.deviation;
    let at = |series: &[f64]| series.get(step).copied();
    let mut text = format!("t = {step}");
    if let Some(bound) = at(&deviation.bound) {
        text += &format!(", bound {}", upper(bound));
    }
    if let Some(largest) = at(&deviation.largest) {
        text += &format!(", largest seen {}", upper(largest));
    }
    if let Some(exact) = deviation.exact.as_deref().and_then(at) {
        text += &format!(", exact {}", upper(exact));
    }
    text
}

fn description(record: &Record) -> String {
    let bound = &record.deviation.bound;
    let ends = bound.first().zip(bound.last());
    ends.map_or_else(
        || "Deviation bound against the step.".to_owned(),
        |(first, last)| {
            format!(
                "Line chart of the deviation bound against the step: {} at step 0, {} at step {}.",
                lower(*first),
                upper(*last),
                bound.len() - 1
            )
        },
    )
}
