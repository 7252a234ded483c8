//! One moment of the race: what is drawn, and what is said.

use super::words;
use crate::race::record::{FrameRecord, PictureRecord, RaceRecord};
use crate::report::plot::{Plot, coordinate};
use crate::report::text::{counted, escape, lower, minus, number, ordinary};

/// The opponent.
pub(super) const OPPONENT: &str =
    "<circle class=\"halo-fill\" r=\"6\"/><circle class=\"opponent\" r=\"5\"/>";
const EGO: &str = "<path class=\"ego\" d=\"M0-6.5L5.5 0L0 6.5L-5.5 0Z\"/>";
const RECOVERY: &str = "<path class=\"halo thin\" d=\"M-4-4L4 4M-4 4L4-4\"/>\
    <path class=\"bad-line\" d=\"M-4-4L4 4M-4 4L4-4\"/>";
/// Radius of the cone at the opponent's height, m.
const CONE: f64 = 0.2;
/// Many points are written as whole tenths of a plot unit, in a group scaled by a tenth.
const FINE: f64 = 10.0;

/// What the moments share.
pub(super) struct Scene<'a> {
    picture: &'a PictureRecord,
    /// Edges of the columns and rows of the slice; one more than cells each.
    edges: Option<[Vec<f64>; 2]>,
}

impl<'a> Scene<'a> {
    /// The scene of a race.
    pub(super) fn new(picture: &'a PictureRecord) -> Self {
        let edges = edges(&picture.slice_x).zip(edges(&picture.slice_y)).map(|(x, y)| [x, y]);
        Self { picture, edges }
    }

    /// The drawing of moment `index`; of all, only the first is shown to begin with.
    pub(super) fn group(&self, plot: &Plot, index: usize) -> String {
        let frame = &self.picture.frames[index];
        let shown = if index == 0 { " shown" } else { "" };
        format!(
            "<g class=\"moment{shown}\" data-moment=\"{index}\">\
             <g class=\"fine\" transform=\"scale(.1)\">{}{}</g>{}{}{}</g>",
            self.cells(plot, frame),
            fan(plot, frame),
            cone(plot, frame),
            self.paths(plot, index),
            marks(plot, frame),
        )
    }

    /// Certified cells: one rectangle for each run of them in a row.
    fn cells(&self, plot: &Plot, frame: &FrameRecord) -> String {
        let (Some([x, y]), Some(certified)) = (&self.edges, &frame.certified) else {
            return String::new();
        };
        let columns = x.len() - 1;
        if certified.len() != columns * (y.len() - 1) {
            return String::new();
        }
        let mut data = String::new();
        for (row, cells) in certified.chunks(columns).enumerate() {
            let [bottom, top] = [y[row], y[row + 1]].map(|y| fine(plot.down(y)));
            for run in runs(cells) {
                let [from, to] = run.map(|column| fine(plot.across(x[column])));
                data += &format!("M{from} {bottom}H{to}V{top}H{from}Z");
            }
        }
        drawn("certified", &data)
    }

    /// Both drones' ways so far.
    fn paths(&self, plot: &Plot, index: usize) -> String {
        let so_far = &self.picture.frames[..=index];
        let path = |class: &str, body: usize| {
            let points = so_far.iter().filter_map(|frame| place(&frame.x, body));
            drawn(class, &plot.line(points))
        };
        path("path-opponent", 6) + &path("path-ego", 0)
    }
}

fn drawn(class: &str, data: &str) -> String {
    if data.is_empty() {
        return String::new();
    }
    format!("<path class=\"{class}\" d=\"{data}\"/>")
}

fn fine(value: f64) -> i64 {
    // Far points stay outside the axes; a cast of what is not a number gives 0.
    (FINE * value.clamp(-400.0, 550.0)).round() as i64
}

/// Edges halfway between ascending centres; `None` for fewer than two.
fn edges(centers: &[f32]) -> Option<Vec<f64>> {
    let centers: Vec<f64> = centers.iter().map(|&center| f64::from(center)).collect();
    let ascending = centers.windows(2).all(|pair| pair[0] < pair[1]);
    let [first, second, ..] = centers[..] else { return None };
    let [.., before, last] = centers[..] else { return None };
    if !ascending || !ordinary(first) || !ordinary(last) {
        return None;
    }
    let inner = centers.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0);
    let outer = [first - (second - first) / 2.0, last + (last - before) / 2.0];
    Some(std::iter::once(outer[0]).chain(inner).chain([outer[1]]).collect())
}

/// First column and end of each run of certified cells.
fn runs(cells: &[bool]) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (column, _) in cells.iter().enumerate().filter(|(_, certified)| **certified) {
        match runs.last_mut() {
            Some([_, end]) if *end == column => *end = column + 1,
            _ => runs.push([column, column + 1]),
        }
    }
    runs
}

/// All plans as one path: the first point of each, then the way from point to point.
fn fan(plot: &Plot, frame: &FrameRecord) -> String {
    let mut data = String::new();
    for plan in &frame.fan {
        let finite = |point: &&[f32; 2]| point.iter().all(|&value| ordinary(value.into()));
        let mut last: Option<[i64; 2]> = None;
        for [x, y] in plan.iter().take_while(finite).map(|point| point.map(f64::from)) {
            let here = [fine(plot.across(x)), fine(plot.down(y))];
            data += &match last {
                None => format!("M{}l", joined(here)),
                Some([x, y]) => joined([here[0] - x, here[1] - y]),
            };
            last = Some(here);
        }
    }
    // A plan of one point has nowhere to go.
    drawn("fan", data.trim_end_matches('l'))
}

/// Two numbers with a space before each that has no sign.
fn joined(point: [i64; 2]) -> String {
    let write = |value: i64| if value < 0 { value.to_string() } else { format!(" {value}") };
    point.map(write).concat()
}

/// Position of a body in the plane, if it is a pair of numbers.
fn place(state: &[f32], body: usize) -> Option<[f64; 2]> {
    let at = |entry: usize| state.get(entry).map(|&value| f64::from(value));
    let point = [at(body)?, at(body + 2)?];
    point.iter().all(|&value| ordinary(value)).then_some(point)
}

/// Radius of the opponent's cone at the height of the ego, m.
fn cone_radius(state: &[f32]) -> Option<f64> {
    let (ego, opponent) = (f64::from(*state.get(4)?), f64::from(*state.get(10)?));
    let radius = CONE * (1.0 + (opponent - ego).max(0.0));
    ordinary(opponent - ego).then_some(radius)
}

fn circle(plot: &Plot, class: &str, [x, y]: [f64; 2], radius: f64) -> String {
    let [across, down] = [plot.across(x), plot.down(y)].map(coordinate);
    let radius = coordinate(plot.lengths(radius)[0]);
    format!("<circle class=\"{class}\" cx=\"{across}\" cy=\"{down}\" r=\"{radius}\"/>")
}

fn cone(plot: &Plot, frame: &FrameRecord) -> String {
    let at = place(&frame.x, 6).zip(cone_radius(&frame.x));
    at.map_or_else(String::new, |(at, radius)| circle(plot, "cone", at, radius))
}

/// The ball, the recovery point and both drones.
fn marks(plot: &Plot, frame: &FrameRecord) -> String {
    let mut marks = String::new();
    if let Some(ball) = frame.ball {
        let (center, radius) = (ball.center.map(f64::from), f64::from(ball.radius));
        if center.iter().all(|&value| ordinary(value)) && ordinary(radius) && radius >= 0.0 {
            let class = if ball.verified { "ball" } else { "ball unverified" };
            marks += &circle(plot, "ball-halo", center, radius);
            marks += &circle(plot, class, center, radius);
        }
    }
    let recovery = frame.recovery.map(|point| point.map(f64::from));
    let recovery = recovery.filter(|point| point.iter().all(|&value| ordinary(value)));
    marks += &mark(plot, recovery, RECOVERY);
    marks += &mark(plot, place(&frame.x, 6), OPPONENT);
    marks + &mark(plot, place(&frame.x, 0), EGO)
}

fn mark(plot: &Plot, point: Option<[f64; 2]>, drawing: &str) -> String {
    point.map_or_else(String::new, |[x, y]| {
        let [across, down] = [plot.across(x), plot.down(y)].map(coordinate);
        format!("<g transform=\"translate({across} {down})\">{drawing}</g>")
    })
}

/// Step, time and tier of a moment in one line.
pub(super) fn title(record: &RaceRecord, picture: &PictureRecord, index: usize) -> String {
    let frame = &picture.frames[index];
    let last = picture.frames.last().map_or(0, |frame| frame.step);
    let tier = frame.tier.map_or_else(String::new, |tier| format!(", tier {tier}"));
    let seconds = number(f64::from(frame.step) * record.step_seconds);
    format!("Step {} of {last}, {seconds} s{tier}", frame.step)
}

/// What there is to say about a moment; of all, only the first is shown to begin with.
pub(super) fn said(record: &RaceRecord, picture: &PictureRecord, index: usize) -> String {
    let frame = &picture.frames[index];
    let shown = if index == 0 { " shown" } else { "" };
    let rows: String = rows(frame)
        .into_iter()
        .map(|(name, value)| format!("<dt>{name}</dt><dd>{}</dd>", escape(&value)))
        .collect();
    format!(
        "<div class=\"moment{shown}\" data-moment=\"{index}\" data-title=\"{}\">\
         <dl>{rows}</dl></div>",
        escape(&title(record, picture, index))
    )
}

/// Names and values; the same names at every moment, so that the eye finds its row again.
fn rows(frame: &FrameRecord) -> Vec<(&'static str, String)> {
    let tier = match frame.tier {
        Some(tier) => format!("{tier}, {}", words::tier(tier)),
        None => "–".to_owned(),
    };
    vec![
        ("Tier", tier),
        ("V_check", check(frame)),
        ("Certified cells", certified(frame)),
        ("Ball", ball(frame)),
        ("Recovery point", frame.recovery.map_or_else(dash, |at| place_words(&at))),
        ("Ego at", entries(&frame.x, [0, 2, 4], "m")),
        ("Ego velocity", entries(&frame.x, [1, 3, 5], "m/s")),
        ("Opponent at", entries(&frame.x, [6, 8, 10], "m")),
        ("Opponent velocity", entries(&frame.x, [7, 9, 11], "m/s")),
        ("Control", frame.u.as_ref().map_or_else(dash, |u| list(u.iter().copied()))),
    ]
}

fn dash() -> String {
    "–".to_owned()
}

fn check(frame: &FrameRecord) -> String {
    frame.check_margin.map_or_else(dash, |margin| {
        let meaning = if margin > 0.0 { "certified" } else { "not certified" };
        format!("{}, {meaning}", minus(&lower(margin.into())))
    })
}

fn certified(frame: &FrameRecord) -> String {
    frame.certified.as_ref().map_or_else(dash, |cells| {
        let certified = cells.iter().filter(|&&cell| cell).count();
        format!("{certified} of {}", cells.len())
    })
}

fn ball(frame: &FrameRecord) -> String {
    frame.ball.map_or_else(dash, |ball| {
        let outcome = if ball.verified { "verified" } else { "not verified" };
        let rounds = counted(ball.rounds as usize, "round", "rounds");
        let radius = f64::from(ball.radius);
        let radius = lower(radius);
        format!("radius {radius} m, {outcome} after {rounds}")
    })
}

fn place_words(at: &[f32]) -> String {
    format!("{} m", list(at.iter().copied()))
}

fn entries(state: &[f32], entries: [usize; 3], unit: &str) -> String {
    let values: Vec<f32> = entries.iter().filter_map(|&entry| state.get(entry).copied()).collect();
    if values.len() < entries.len() {
        return dash();
    }
    format!("{} {unit}", list(values.into_iter()))
}

/// Values with a fixed number of decimals, so that they do not jump from moment to moment.
fn list(values: impl Iterator<Item = f32>) -> String {
    let write = |value: f32| {
        if !ordinary(value.into()) {
            return "not finite".to_owned();
        }
        let text = format!("{value:.2}");
        if text == "-0.00" { "0.00".to_owned() } else { text.replace('-', "−") }
    };
    values.map(write).collect::<Vec<_>>().join(", ")
}
