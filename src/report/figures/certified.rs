//! The certified set in the slice, the ball of local growth and its sampled starts.

use super::plane::{entry, margins, no_slice, point, same_unit, slice_states, target_area};
use crate::report::figure::{Figure, Swatch, cross, diamond, dot};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::{lower, ordinary};
use crate::report::words;
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
    /// Whether the ball extends along each axis of the slice.
    extends: [bool; 2],
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
        let away: f64 = (0..center.len())
            .filter(|&state| varies(state) && !states.contains(&state))
            .filter_map(|state| Some(entry(center, state)? - entry(&record.state.x, state)?))
            .map(|gap| gap * gap)
            .sum();
        let left = radius * radius - away;
        ordinary(radius).then_some(Self {
            center: point(center, states)?,
            radius,
            section: (left > 0.0).then(|| left.sqrt()),
            extends: states.map(varies),
        })
    }

    /// Whether the shadow is a different circle from the section.
    fn shadowed(&self) -> bool {
        self.section.is_none_or(|section| section < 0.999 * self.radius)
    }

    fn draw(&self, plot: &mut Plot, verified: bool) {
        let half = |plot: &Plot, radius: f64| {
            let lengths = plot.lengths(radius);
            [0, 1].map(|axis| if self.extends[axis] { lengths[axis] } else { 0.0 })
        };
        if self.shadowed() {
            let half = half(plot, self.radius);
            plot.ellipse("shadow", self.center, half);
        }
        if let Some(section) = self.section {
            let class = if verified { "ball" } else { "ball unverified" };
            let half = half(plot, section);
            plot.ellipse("ball-halo", self.center, half);
            plot.ellipse(class, self.center, half);
        }
    }
}

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let ball = Ball::new(record);
    Figure {
        id: "figure-certified",
        title: "Certified set, ball and starts".to_owned(),
        drawing: grid.map_or_else(|| no_slice(record), |grid| Ok(drawing(grid, ball.as_ref()))),
        legend: grid.map_or_else(Vec::new, |_| legend(record, ball.as_ref())),
        caption: caption(record, ball.as_ref()),
    }
}

fn legend(record: &Record, ball: Option<&Ball>) -> Vec<(Swatch, String)> {
    let growth = &record.growth;
    let verified = growth.outcome == GrowthOutcome::Verified;
    let entry = |swatch: Swatch, name: &str| (swatch, name.to_owned());
    let mut legend = vec![
        entry(Swatch::Area("certified"), "certified cells: V_check > 0"),
        entry(Swatch::Area("target-area target"), "target set in this slice"),
        entry(Swatch::Area("hatched constraint"), "constraint violated"),
        entry(Swatch::Mark(diamond()), "state"),
    ];
    if let Some(ball) = ball {
        let mark = CENTER.to_owned();
        legend.push(if verified {
            (Swatch::Marked("ball", mark), "verified ball, its cut through this plane".to_owned())
        } else {
            (Swatch::Marked("ball unverified", mark), "last ball tried: not verified".to_owned())
        });
        if ball.shadowed() {
            legend.push(entry(Swatch::Line("shadow"), "shadow of the whole ball"));
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

fn caption(record: &Record, ball: Option<&Ball>) -> String {
    let values = &record.slice.check_margin;
    if values.is_empty() {
        return without_slice(record);
    }
    let positive = values.iter().filter(|&&value| value > 0.0).count();
    let mut caption = format!("{positive} of {} cells are certified.", values.len());
    let varied = record.growth.varies.iter().filter(|&&varies| varies).count();
    match (record.growth.outcome, ball) {
        (GrowthOutcome::NoBoundary, _) => {
            caption += " No boundary of the certified set was found, so there is no ball.";
        }
        (outcome, Some(ball)) => {
            let kind = match outcome {
                GrowthOutcome::Verified => "verified ball",
                _ => "last ball tried, which is not verified,",
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
        (_, None) => caption += " The centre of the ball cannot be drawn.",
    }
    caption
}

/// What is known of the set and the ball where there is no slice.
fn without_slice(record: &Record) -> String {
    let global = &record.global;
    let set = format!("{} of {} starts drawn are certified.", global.accepted, global.draws);
    match record.growth.outcome {
        GrowthOutcome::Verified => {
            format!("{set} The verified ball has radius {}.", lower(record.growth.radius))
        }
        GrowthOutcome::Exhausted => format!("{set} No ball is verified."),
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
        // Something far off must not shrink the slice to a speck.
        let (low, high) = (spans[axis].low, spans[axis].high);
        let near = |value: f64| value.clamp(2.0 * low - high, 2.0 * high - low);
        let circle = ball.map(|ball| {
            let reach = if ball.extends[axis] { 1.04 * ball.radius } else { 0.0 };
            [ball.center[axis] - reach, ball.center[axis] + reach]
        });
        let all = marks.chain(circle.into_iter().flatten()).map(near);
        spans[axis] = Span::of(all.chain([low, high])).unwrap_or(spans[axis]);
    }
    spans
}

fn drawing(grid: &Grid, ball: Option<&Ball>) -> String {
    let record = grid.record;
    let states = slice_states(record);
    let [x, y] = spans(grid, ball);
    let shape =
        if same_unit(record, states) { Proportions::Equal } else { Proportions::Free(330.0) };
    let mut plot = Plot::new("certified", x, y, shape);
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
    plot.finish(&labels, &format!("Map of the slice. {}", caption(record, ball)))
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
