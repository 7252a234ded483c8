//! Success against latency: every point, the Pareto front joined, its knee named.

use super::front::{Candidate, Front};
use super::grid::Grid;
use super::lines::{self, Layout, Shown};
use super::readings::{LATENCY, SUCCESS};
use crate::report::figure::{Figure, Swatch};
use crate::report::plot::{Labels, Plot, coordinate};
use crate::report::scale::Scale;
use crate::report::span::Span;
use crate::report::text::{escape, most_percent, shorten};

/// Width and height.
const SIZE: [f64; 2] = [440.0, 280.0];
/// Percent above which a name above the front would meet the ceiling.
const ROOM: f64 = 78.0;
/// Characters of the knee's name in the drawing.
const NAME: usize = 34;
/// A point whose line has no colour of its own.
const REST: &str = "<circle class=\"spot rest\" r=\"3\"/>";
const KNEE: &str = "<circle class=\"knee\" r=\"8\"/>";

/// The figure; `ceiling` is the share that cannot be exceeded.
pub(super) fn figure(grid: &Grid<'_>, front: Option<&Front>, ceiling: Option<f64>) -> Figure {
    Figure {
        id: "figure-front",
        title: "Races won against latency".to_owned(),
        drawing: match front {
            Some(front) => Ok(drawing(grid, front, ceiling)),
            None => Err("No point has both a success rate and a latency.".to_owned()),
        },
        legend: front.map_or_else(Vec::new, |front| legend(grid, front, ceiling)),
        caption: front.map_or_else(String::new, |front| caption(grid, front)),
    }
}

/// The mark of a point, in the colour of its line.
fn mark(layout: &Layout<'_, '_>, candidate: &Candidate) -> String {
    let Some(Shown { axis, places }) = &layout.lines else {
        return lines::mark(0);
    };
    let place = layout.slice.grid.points[candidate.index].places[*axis];
    let line = places.iter().position(|&shown| shown == place);
    line.map_or_else(|| REST.to_owned(), lines::mark)
}

fn drawing(grid: &Grid<'_>, front: &Front, ceiling: Option<f64>) -> String {
    let [width, height] = SIZE;
    let axes = [front.scale.axis(6.0), Scale::linear(0.0, 100.0).axis(height / 46.0)];
    let mut plot = Plot::ticked("front", axes, height, [width, 0.0]);
    let at = |candidate: &Candidate| [front.scale.place(candidate.cost), candidate.gain];
    if let Some(share) = ceiling {
        let span = front.scale.span();
        let line = plot.line([span.low, span.high].map(|place| [place, 100.0 * share]));
        plot.path("ceiling", &line);
    }
    let line = plot.line(front.joined.iter().map(at));
    plot.path("front", &line);
    let layout = Layout::new(grid, 2);
    for candidate in &front.candidates {
        plot.mark(at(candidate), &mark(&layout, candidate));
    }
    if let Some(knee) = &front.knee {
        plot.mark(at(knee), KNEE);
        let name = shorten(&grid.name(&grid.points[knee.index]), NAME);
        label(&mut plot, front, at(knee), &format!("knee: {name}"));
    }
    let labels = Labels { x: LATENCY.label, y: SUCCESS.label, whole: false };
    plot.finish(&labels, "Races won against the latency of a control step")
}

/// The knee's name with a line to it: above the front, where no point is, if there is room.
fn label(plot: &mut Plot, front: &Front, [across, up]: [f64; 2], name: &str) {
    let highest = front.joined.last().map_or(0.0, |best| best.gain);
    let height = if highest < ROOM { highest + 12.0 } else { 8.0 };
    let side = if height > up { -1.0 } else { 1.0 };
    let [from, to] = [up, height].map(|gain| plot.down(gain));
    let line = format!("M0 {}V{}", coordinate(8.0 * side), coordinate(to - from - 4.0 * side));
    plot.mark([across, up], &format!("<path class=\"leader\" d=\"{line}\"/>"));
    // Half the text, at most, fits left and right of the middle.
    let half = 4.1 * name.chars().count() as f64;
    let at = plot.across(across);
    let Span { low, high } = front.scale.span();
    let [left, right] = [plot.across(low) + half + 4.0, plot.across(high) - half - 4.0];
    let shift = at.min(right).max(left) - at;
    plot.mark(
        [across, height],
        &format!(
            "<text class=\"knee-name\" x=\"{}\" y=\"4\" text-anchor=\"middle\">{}</text>",
            coordinate(shift),
            escape(name)
        ),
    );
}

fn legend(grid: &Grid<'_>, front: &Front, ceiling: Option<f64>) -> Vec<(Swatch, String)> {
    let layout = Layout::new(grid, 2);
    let mut legend = layout.legend(|index| Swatch::Mark(lines::mark(index)));
    if let Some(Shown { axis, places }) = &layout.lines
        && places.len() < grid.axes[*axis].values.len()
    {
        legend.push((Swatch::Mark(REST.to_owned()), "other values".to_owned()));
    }
    legend.push((Swatch::Line("front"), "Pareto front".to_owned()));
    if front.knee.is_some() {
        legend.push((Swatch::Mark(KNEE.to_owned()), "knee of the front".to_owned()));
    }
    if let Some(share) = ceiling {
        legend.push((
            Swatch::Line("ceiling"),
            format!("most that can be won: {}", most_percent(share)),
        ));
    }
    legend
}

fn caption(grid: &Grid<'_>, front: &Front) -> String {
    let logarithm = if front.scale.is_log() { "the logarithm of the latency" } else { "latency" };
    let knee = match (&front.knee, front.joined.len()) {
        (Some(knee), _) => format!(
            "The knee, {}, is the point of the front that lies farthest above the chord between \
             its two ends, with {logarithm} and the success rate each scaled to [0, 1].",
            grid.name(&grid.points[knee.index])
        ),
        (None, 0 | 1) => "The front is a single point and has no knee.".to_owned(),
        (None, 2) => "A front of two points has no knee.".to_owned(),
        (None, _) => format!(
            "No point of the front lies above the chord between its two ends, with {logarithm} \
             and the success rate each scaled to [0, 1]: it has no knee."
        ),
    };
    format!(
        "Every point of the sweep; the front joins those that no other point beats in one and \
         equals or beats in the other. {knee} Rates and latencies are estimates, and so is the front."
    )
}
