//! The certified set in the slice, the ball of local growth and its sampled starts.

use super::plane::{margins, no_slice, seen, slice_states, target_area};
use crate::report::figure::{Figure, Swatch, cross, diamond, dot};
use crate::report::places::{entry, point, same_unit};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::{lower, ordinary};
use crate::report::words;
use crate::scenario::growth_plan::GrowthShape;
use crate::scenario::record::{GrowthOutcome, Record};

const CENTER: &str = "<path class=\"center\" d=\"M-6 0H6M0-6V6\"/>";

/// The ball as the plane of the slice sees it.
struct Ball {
    /// Centre in the plane.
    center: [f64; 2],
    /// Radius of the whole ball, hence of its shadow on the plane.
    radius: f64,
    /// Radius of what the plane cuts out of it; `None` if it passes by.
    section: Option<f64>,
    /// Half-width along each axis of the slice at radius 1; 0 where it does not extend.
    widths: [f64; 2],
    /// Whether it has corners.
    shape: GrowthShape,
}

impl Ball {
    /// The verified ball, or the last one tried.
    fn new(record: &Record) -> Option<Self> {
        let growth = &record.growth;
        let radius = match growth.outcome {
            GrowthOutcome::Verified => growth.radius,
            GrowthOutcome::Exhausted => growth.rounds.last()?.radius,
            GrowthOutcome::NoBoundary => return None,
        };
        let states = slice_states(record);
        let center = growth.center.as_deref()?;
        let varies = |state: usize| growth.varies.get(state).copied().unwrap_or(true);
        let (upward, shape) = (growth.upward.as_ref(), growth.shape());
        let width = |state: usize| match upward {
            Some(upward) => upward.widths.get(state).map_or(0.0, |width| f64::from(*width)),
            None => f64::from(u8::from(varies(state))),
        };
        let away = (0..center.len())
            .filter(|&state| width(state) > 0.0 && !states.contains(&state))
            .filter_map(|state| {
                let gap = entry(center, state)? - entry(&record.state.x, state)?;
                Some((gap / width(state)).powi(2))
            });
        let section = match shape {
            GrowthShape::Box => {
                let inside = away.fold(0.0, f64::max) < radius * radius;
                inside.then_some(radius)
            }
            _ => {
                let left = radius * radius - away.sum::<f64>();
                (left > 0.0).then(|| left.sqrt())
            }
        };
        ordinary(radius).then_some(Self {
            center: point(center, states)?,
            radius,
            section,
            widths: states.map(width),
            shape,
        })
    }

    /// Whether the shadow is a different circle from the section.
    fn shadowed(&self) -> bool {
        self.section.is_none_or(|section| section < 0.999 * self.radius)
    }

    fn draw(&self, plot: &mut Plot, verified: bool) {
        if self.shadowed() {
            self.outline(plot, "shadow", self.radius);
        }
        if let Some(section) = self.section {
            self.outline(plot, "ball-halo", section);
            self.outline(plot, if verified { "ball" } else { "ball unverified" }, section);
        }
    }

    /// The set of that radius in the plane, its centre in the middle.
    fn outline(&self, plot: &mut Plot, class: &str, radius: f64) {
        let half = self.widths.map(|width| radius * width);
        let [x, y] = self.center;
        if self.shape == GrowthShape::Box {
            let data = plot.rectangle([x - half[0], y - half[1], x + half[0], y + half[1]]);
            return plot.path(class, &data);
        }
        let lengths = [0, 1].map(|axis| plot.lengths(half[axis])[axis]);
        plot.ellipse(class, self.center, lengths);
    }
}

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let ball = Ball::new(record);
    Figure {
        id: "figure-certified",
        title: format!("Certified set, {} and starts", words::grown(record)),
        drawing: grid.map_or_else(|| no_slice(record), |grid| Ok(drawing(grid, ball.as_ref()))),
        legend: grid.map_or_else(Vec::new, |grid| legend(grid, ball.as_ref())),
        caption: caption(record, grid, ball.as_ref()),
    }
}

fn legend(grid: &Grid, ball: Option<&Ball>) -> Vec<(Swatch, String)> {
    let record = grid.record;
    let growth = &record.growth;
    let set = words::grown(record);
    let verified = growth.outcome == GrowthOutcome::Verified;
    let entry = |swatch: Swatch, name: &str| (swatch, name.to_owned());
    let (task, seen) = (&record.system.task, seen(grid));
    let certified = entry(Swatch::Area("certified"), "certified cells: V_check > 0");
    let target = entry(Swatch::Area("target-area target"), "target set in this slice");
    let violated = entry(Swatch::Area("hatched constraint"), "constraint violated");
    let mut legend = Vec::new();
    legend.extend((positive(record) > 0).then_some(certified));
    legend.extend((task.has_target() && seen.target).then_some(target));
    legend.extend((task.has_constraint() && seen.violated).then_some(violated));
    legend.push(entry(Swatch::Mark(diamond()), "state"));
    if let Some(ball) = ball {
        let mark = CENTER.to_owned();
        legend.push(if verified {
            (Swatch::Marked("ball", mark), format!("verified {set}, its cut through this plane"))
        } else {
            (Swatch::Marked("ball unverified", mark), format!("last {set} tried: not verified"))
        });
        if ball.shadowed() {
            legend.push((Swatch::Line("shadow"), format!("shadow of the whole {set}")));
        }
    }
    if growth.samples.iter().any(|sample| sample.success) {
        legend.push((Swatch::Mark(dot(3.2)), "start that succeeded".to_owned()));
    }
    if growth.samples.iter().any(|sample| !sample.success) {
        legend.push((Swatch::Mark(cross(3.6)), "start that failed".to_owned()));
    }
    legend
}

/// Cells that are certified.
fn positive(record: &Record) -> usize {
    record.slice.check_margin.iter().filter(|&&value| value > 0.0).count()
}

fn caption(record: &Record, grid: Option<&Grid>, ball: Option<&Ball>) -> String {
    let Some(grid) = grid else { return without_slice(record) };
    let cells = record.slice.check_margin.len();
    let mut caption = format!("{} of {cells} cells are certified.", positive(record));
    let set = words::grown(record);
    let varied = record.growth.varies.iter().filter(|&&varies| varies).count();
    match (record.growth.outcome, ball) {
        (GrowthOutcome::NoBoundary, _) => {
            caption +=
                &format!(" No boundary of the certified set was found, so there is no {set}.");
        }
        (outcome, Some(ball)) => {
            let kind = match outcome {
                GrowthOutcome::Verified => format!("verified {set}"),
                _ => format!("last {set} tried, which is not verified,"),
            };
            let radius = lower(ball.radius);
            caption += &format!(" The {kind} has radius {radius} in {varied} coordinates");
            caption += match ball.section {
                Some(_) if !ball.shadowed() => ".",
                Some(_) => "; its centre lies off this plane, which therefore cuts it smaller.",
                None => "; its centre lies so far off this plane that only its shadow shows.",
            };
            if varied > 2 {
                caption += " Starts are drawn by their shadow on the plane: from many coordinates \
                            most fall near the centre.";
            }
        }
        (_, None) => caption += &format!(" The centre of the {set} cannot be drawn."),
    }
    if frame(grid, ball).exceeds(grid.spans()) {
        caption += " The slice ends where it is grey: no cell and no margin was computed there.";
    }
    caption
}

/// What is known of the set and the ball where there is no slice.
fn without_slice(record: &Record) -> String {
    let global = &record.global;
    let set = format!("{} of {} starts drawn are certified.", global.accepted, global.draws);
    let (grown, radius) = (words::grown(record), lower(record.growth.radius));
    match record.growth.outcome {
        GrowthOutcome::Verified => format!("{set} The verified {grown} has radius {radius}."),
        GrowthOutcome::Exhausted => format!("{set} No {grown} is verified."),
        GrowthOutcome::NoBoundary => format!("{set} No boundary of the set was found."),
    }
}

/// What the figure covers: the slice, the state, the ball and the starts.
fn spans(grid: &Grid, ball: Option<&Ball>) -> [Span; 2] {
    let record = grid.record;
    let states = slice_states(record);
    let mut spans = grid.spans();
    for axis in 0..2 {
        let starts = record.growth.samples.iter().map(|sample| &sample.x);
        let marks = starts.chain([&record.state.x]).filter_map(|x| entry(x, states[axis]));
        let circle = ball.map(|ball| {
            let reach = 1.04 * ball.radius * ball.widths[axis];
            [ball.center[axis] - reach, ball.center[axis] + reach]
        });
        let all = marks.chain(circle.into_iter().flatten());
        spans[axis] = Span::of(all).map_or(spans[axis], |all| all.join(spans[axis]));
    }
    spans
}

/// The empty plot of what the figure covers.
fn frame(grid: &Grid, ball: Option<&Ball>) -> Plot {
    let shape = match same_unit(&grid.record.system.states, slice_states(grid.record)) {
        true => Proportions::Equal,
        false => Proportions::Free(330.0),
    };
    let [x, y] = spans(grid, ball);
    Plot::new("certified", x, y, shape)
}

fn drawing(grid: &Grid, ball: Option<&Ball>) -> String {
    let record = grid.record;
    let states = slice_states(record);
    let mut plot = frame(grid, ball);
    plot.beyond(grid.spans());
    let [across, up] = grid.spans();
    let slice = plot.rectangle([across.low, up.low, across.high, up.high]);
    plot.path("slice", &slice);
    target_area(&mut plot, grid);
    let cells = grid.runs(&record.slice.check_margin, |value| value > 0.0);
    let certified = cells.into_iter().filter(|(certified, _)| *certified);
    let data: String = certified.map(|(_, area)| plot.rectangle(area)).collect();
    plot.path("certified", &data);
    margins(&mut plot, grid);
    starts(&mut plot, record);
    if let Some(ball) = ball {
        ball.draw(&mut plot, record.growth.outcome == GrowthOutcome::Verified);
        plot.mark(ball.center, CENTER);
    }
    if let Some(state) = point(&record.state.x, states) {
        plot.mark(state, &diamond());
    }
    let [x, y] = states.map(|state| words::axis(record, state));
    let labels = Labels { x: &x, y: &y, whole: false };
    plot.finish(&labels, &format!("Map of the slice. {}", caption(record, Some(grid), ball)))
}

/// Failures last, so that none hides behind a success.
fn starts(plot: &mut Plot, record: &Record) {
    for success in [true, false] {
        let drawing = if success { dot(2.2) } else { cross(2.8) };
        let samples = record.growth.samples.iter();
        for sample in samples.filter(|sample| sample.success == success) {
            if let Some(start) = point(&sample.x, slice_states(record)) {
                plot.speck(start, &drawing);
            }
        }
    }
}
