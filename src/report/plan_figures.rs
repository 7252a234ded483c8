//! The plan in time: states, controls, margins and cost terms of the runs, a small plot for each.

use super::figure::{Figure, Swatch};
use super::plan_runs::{PlanPage, class, drawn, legend, shown};
use super::plot::{Labels, Plot, Proportions};
use super::sheet::{WIDTH, panels};
use super::span::Span;
use crate::model::TermKind;
use crate::plan::record::TermRecord;
use crate::plan::{Judged, PlanRecord, Trajectory};
use crate::rounding::as_written;
use crate::system::Axis;

/// Plots of a figure.
const PLOTS: usize = 16;
/// Height of a plot.
const HEIGHT: f64 = 150.0;

/// A line of a plot.
struct Line {
    class: &'static str,
    points: Vec<[f64; 2]>,
}

/// A small plot over time.
struct Panel {
    title: String,
    lines: Vec<Line>,
    /// Values that are marked by a line across: bounds of a control.
    bounds: Vec<f64>,
    /// Whether zero is marked.
    zero: Zero,
}

/// Whether zero is marked.
#[derive(Clone, Copy, PartialEq)]
enum Zero {
    Marked,
    Plain,
}

/// The figures in the order of the page.
pub(super) fn figures(page: &PlanPage<'_>) -> Vec<Figure> {
    let first = [states(page), controls(page)];
    first.into_iter().chain(effective(page)).chain([margins(page), terms(page)]).collect()
}

fn states(page: &PlanPage<'_>) -> Figure {
    let axes = &page.record.system.states;
    let panel = |(i, axis): (usize, &Axis)| Panel {
        title: titled(&axis.name, &axis.unit),
        lines: lines(page, |run, _| values(&run.states, i)),
        bounds: Vec::new(),
        zero: Zero::Plain,
    };
    let all = axes.iter().enumerate().map(panel).collect();
    figure(page, "states", "States", all, "")
}

fn controls(page: &PlanPage<'_>) -> Figure {
    let axes = &page.record.system.controls;
    let panel = |(i, axis): (usize, &Axis)| Panel {
        title: titled(&axis.name, &axis.unit),
        lines: lines(page, |run, _| values(&run.controls, i))
            .into_iter()
            .map(|line| Line { points: held(&line.points, page.record), ..line })
            .collect(),
        bounds: vec![axis.low.into(), axis.high.into()],
        zero: Zero::Plain,
    };
    let all = axes.iter().enumerate().map(panel).collect();
    let caption = " A control is held over its step; dotted lines are its bounds.";
    let mut figure = figure(page, "controls", "Controls", all, caption);
    figure.legend.push((Swatch::Line("constraint"), "bounds".to_owned()));
    figure
}

fn margins(page: &PlanPage<'_>) -> Figure {
    let task = &page.record.system.task;
    let panel = |title: &str, of: fn(&Judged) -> &Vec<f64>| Panel {
        title: title.to_owned(),
        lines: lines(page, |_, judged| of(judged).clone()),
        bounds: Vec::new(),
        zero: Zero::Marked,
    };
    let target = task.has_target().then(|| panel("target margin", |judged| &judged.target));
    let constraint =
        task.has_constraint().then(|| panel("constraint margin", |judged| &judged.constraint));
    let all = target.into_iter().chain(constraint).collect();
    let caption = " Above zero a state is in the target, or safe.";
    let mut figure = figure(page, "margins", "Margins of the task", all, caption);
    figure.legend.push((Swatch::Line("zero"), "0".to_owned()));
    figure
}

fn terms(page: &PlanPage<'_>) -> Figure {
    let panel = |(i, term): (usize, &TermRecord)| {
        let ends = term.kind == TermKind::Terminal;
        let share = move |run: &Trajectory, _: &Judged| {
            let all = values(&run.shares, i);
            // At the last state no stage is paid.
            let paid = if ends { all.len() } else { run.controls.len().min(all.len()) };
            all[..paid].to_vec()
        };
        Panel {
            title: term.key(),
            lines: lines(page, share),
            bounds: Vec::new(),
            zero: Zero::Plain,
        }
    };
    let all = page.record.cost.terms.iter().enumerate().map(panel).collect();
    let caption = " A term with its weight, at the state of each step; a terminal term is what a plan \
                   that ended there would pay, and a run pays it at its last state alone.";
    figure(page, "terms", "What the cost is made of", all, caption)
}

/// Effective samples over time.
fn effective(page: &PlanPage<'_>) -> Option<Figure> {
    let samples = page.record.plans.samples;
    let panel = Panel {
        title: format!("effective samples, of {samples}"),
        lines: lines(page, |run, _| run.effective.clone()),
        bounds: Vec::new(),
        zero: Zero::Plain,
    };
    let caption = " 1 / sum of the squared weights: near 1 one sample is the plan, near all of them \
                   their weights say little.";
    (samples > 1).then(|| figure(page, "effective", "Effective samples", vec![panel], caption))
}

/// A line for each drawn run.
fn lines(page: &PlanPage<'_>, of: impl Fn(&Trajectory, &Judged) -> Vec<f64>) -> Vec<Line> {
    let scale = seconds(page.record).unwrap_or(1.0);
    let line = |(run, judged): (&Trajectory, &Judged)| {
        let values = of(run, judged).into_iter().enumerate();
        let points = values.map(|(step, value)| [step as f64 * scale, value]).collect();
        Line { class: class(judged), points }
    };
    drawn(page).map(line).collect()
}

/// Seconds of a step, where the model says.
fn seconds(record: &PlanRecord) -> Option<f64> {
    record.period.map(as_written)
}

/// The numbers `i` of rows.
fn values(rows: &[Vec<f32>], i: usize) -> Vec<f64> {
    rows.iter().map(|row| row.get(i).map_or(f64::NAN, |value| f64::from(*value))).collect()
}

/// The corners of numbers that are held over their steps.
fn held(points: &[[f64; 2]], record: &PlanRecord) -> Vec<[f64; 2]> {
    let step = seconds(record).unwrap_or(1.0);
    points.iter().flat_map(|&[from, value]| [[from, value], [from + step, value]]).collect()
}

fn titled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }
}

/// A figure of small plots; of many, the first.
fn figure(
    page: &PlanPage<'_>,
    id: &'static str,
    title: &str,
    mut all: Vec<Panel>,
    caption: &str,
) -> Figure {
    let more = all.len().saturating_sub(PLOTS);
    all.truncate(PLOTS);
    let drawings: Vec<(String, String)> = all
        .iter()
        .enumerate()
        .map(|(i, panel)| (panel.title.clone(), panel.drawing(&format!("{id}-{i}"), page.record)))
        .collect();
    let left_out = match more {
        0 => String::new(),
        _ => format!(" {more} more are in steps.csv."),
    };
    Figure {
        id,
        title: title.to_owned(),
        drawing: Ok(panels(&drawings)),
        legend: legend(page),
        caption: format!("{}{caption}{left_out}", shown(page.record)),
    }
}

impl Panel {
    fn drawing(&self, id: &str, record: &PlanRecord) -> String {
        let values = self.lines.iter().flat_map(|line| line.points.iter().map(|point| point[1]));
        let zero = (self.zero == Zero::Marked).then_some(0.0);
        let Some(span) =
            Span::of(values.chain(self.bounds.iter().copied()).chain(zero)).map(Span::opened)
        else {
            return "<p class=\"empty\">No number of it can be drawn.</p>".to_owned();
        };
        let end = f64::from(record.steps) * seconds(record).unwrap_or(1.0);
        let across = Span { low: 0.0, high: end };
        let free = Proportions::Free(HEIGHT);
        let mut plot = Plot::across_width(id, across, span.widened(0.08), free, WIDTH);
        let level = |plot: &Plot, value: f64| plot.line([[0.0, value], [end, value]]);
        for bound in &self.bounds {
            let line = level(&plot, *bound);
            plot.path("constraint", &line);
        }
        if self.zero == Zero::Marked {
            let line = level(&plot, 0.0);
            plot.path("zero", &line);
        }
        for Line { class, points } in &self.lines {
            let line = plot.line(points.iter().copied());
            plot.path(class, &line);
        }
        let x = if record.period.is_some() { "time (s)" } else { "step" };
        let labels = Labels { x, y: &self.title, whole: record.period.is_none() };
        plot.finish(&labels, &format!("{} against time", self.title))
    }
}
