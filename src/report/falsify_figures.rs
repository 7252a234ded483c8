//! The figures of a search for failures: how near it came, and the failures in a plane.

use super::figure::{Figure, Swatch, cross};
use super::places::titled;
use super::plot::{Labels, Plot, Proportions};
use super::span::Span;
use super::text::{count, ordinary};
use crate::rollout::Region;
use crate::scenario::falsify::FalsifyRecord;
use crate::system::Axis;

/// The start with the smallest measure.
const BEST: &str = "<circle class=\"ring\" r=\"8\"/>";

/// The smallest measure so far, start by start.
pub(super) fn progress(record: &FalsifyRecord) -> Figure {
    let values = record.improvements.iter().map(|one| one.measure);
    let drawing = match Span::of(values.chain([0.0])) {
        Some(values) if !record.improvements.is_empty() => {
            let x = Span { low: 0.0, high: record.rollouts.max(1) as f64 };
            let mut plot = Plot::new("progress", x, values.widened(0.08), Proportions::Free(250.0));
            let zero = plot.line([[x.low, 0.0], [x.high, 0.0]]);
            plot.path("zero", &zero);
            let line = plot.line(stairs(record));
            plot.path("bound", &line);
            let labels = Labels { x: "rollouts", y: "smallest measure so far", whole: true };
            Ok(plot.finish(&labels, "The smallest measure so far against the rollouts"))
        }
        _ => Err("No start was tried that counts.".to_owned()),
    };
    Figure {
        id: "progress",
        title: "Smallest measure so far".to_owned(),
        drawing,
        legend: vec![
            (Swatch::Line("bound"), "smallest measure so far".to_owned()),
            (Swatch::Line("zero"), "0: at or below it a start fails".to_owned()),
        ],
        caption: "Uniform draws first, then clouds by cross-entropy and descent.".to_owned(),
    }
}

/// The corners of the measure so far: it stays until the next improvement.
fn stairs(record: &FalsifyRecord) -> Vec<[f64; 2]> {
    let each = if record.pairs.is_empty() { 1 } else { 2 };
    let place = |index: u64| (each * index) as f64;
    let ordinary = record.improvements.iter().filter(|one| ordinary(one.measure));
    let mut corners: Vec<[f64; 2]> = Vec::new();
    for one in ordinary {
        corners.extend(corners.last().map(|last| [place(one.index), last[1]]));
        corners.push([place(one.index), one.measure]);
    }
    corners.extend(corners.last().map(|last| [record.rollouts as f64, last[1]]));
    corners
}

/// The failures in the plane of the first two coordinates that vary; none where there are not two.
pub(super) fn plane(record: &FalsifyRecord, axes: &[Axis], region: &Region) -> Option<Figure> {
    let varies = region.varies();
    let mut varying = (0..axes.len()).filter(|&state| varies.get(state) == Some(&true));
    let states = [varying.next()?, varying.next()?];
    let at = |x: &Vec<f32>| states.map(|state| x.get(state).map_or(f64::NAN, |x| f64::from(*x)));
    let starts = record.starts.iter().map(|start| &start.x);
    let failing: Vec<[f64; 2]> =
        starts.chain(record.pairs.iter().map(|pair| &pair.perturbed.x)).map(at).collect();
    let best = record.best.as_ref().map(|best| at(&best.x));
    let sides = states.map(|state| side(region, state));
    let all = |axis: usize| failing.iter().chain(&best).map(move |point| point[axis]);
    let span = |axis: usize| Span::of(all(axis).chain(sides[axis])).map(|span| span.widened(0.04));
    let mut plot = Plot::new("plane", span(0)?, span(1)?, Proportions::Free(330.0));
    let [[left, right], [low, high]] = sides;
    let outline = plot.rectangle([left, low, right, high]);
    plot.path("slice", &outline);
    failing.iter().for_each(|point| plot.mark(*point, &cross(4.0)));
    best.into_iter().for_each(|point| plot.mark(point, BEST));
    let [x, y] = states.map(|state| titled(axes, state));
    let labels = Labels { x: &x, y: &y, whole: false };
    let shown = failing.len();
    Some(Figure {
        id: "plane",
        title: "Failures by two coordinates".to_owned(),
        drawing: Ok(plot.finish(&labels, &format!("{shown} failing starts in a plane"))),
        legend: [
            (shown > 0).then(|| (Swatch::Mark(cross(3.6)), "start that fails".to_owned())),
            best.map(|_| (Swatch::Mark(BEST.to_owned()), "smallest measure".to_owned())),
            Some((Swatch::Area("slice"), "where starts were looked for".to_owned())),
        ]
        .into_iter()
        .flatten()
        .collect(),
        caption: format!(
            "Shadows on the plane of the first two coordinates that vary. {}",
            drawn(record, shown)
        ),
    })
}

/// Which starts are drawn, and which are not.
fn drawn(record: &FalsifyRecord, shown: usize) -> String {
    let worst = match (shown as u64) < record.failures {
        true => {
            format!("Of {} starts that fail the worst {shown} are drawn", count(record.failures))
        }
        false => "All starts that fail are drawn".to_owned(),
    };
    let worst = if shown == 0 { "No start fails".to_owned() } else { worst };
    format!("{worst}; those that pass are not kept.")
}

/// The ends of a region along a state.
fn side(region: &Region, state: usize) -> [f64; 2] {
    let [low, high] = match region {
        Region::Box { low, high } => [low[state], high[state]],
        Region::Ball(ball) => [-1.0, 1.0].map(|sign| ball.center[state] + sign * ball.radius),
        Region::Ellipsoid(set) => {
            [-1.0, 1.0].map(|sign| set.center[state] + sign * set.half_axes[state])
        }
    };
    [low, high].map(f64::from)
}
