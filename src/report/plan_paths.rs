//! The paths of plans in closed loop in a plane, over the margins there.

use super::contour::Field;
use super::figure::{Figure, Swatch, cross, dot};
use super::plan_runs::{PlanPage, class, drawn, legend, shown};
use super::plot::{Labels, Plot, Proportions};
use super::span::Span;
use super::text::ordinary;
use crate::plan::{Plane, Trajectory};

/// The mark at a start.
const START: &str = "<circle class=\"start body first\" r=\"3.6\"/>";

/// The figure; none of a model that has no plane.
pub(super) fn figure(page: &PlanPage<'_>) -> Option<Figure> {
    let plane = page.plane?;
    let mut legend = legend(page);
    let task = &page.record.system.task;
    let target = (Swatch::Area("target-area target"), "target".to_owned());
    let violated = (Swatch::Area("hatched constraint"), "constraint violated".to_owned());
    legend.push((Swatch::Mark(START.to_owned()), "start".to_owned()));
    legend.extend(task.has_target().then_some(target));
    legend.extend(task.has_constraint().then_some(violated));
    Some(Figure {
        id: "paths",
        title: "Paths".to_owned(),
        drawing: drawing(page, plane),
        legend,
        caption: format!(
            "{} Target and constraint are those of step 0 with the other states as at the first start, and \
             none was computed where it is grey; a run that did what the task asks ends in a dot, another in a cross.",
            shown(page.record)
        ),
    })
}

fn drawing(page: &PlanPage<'_>, plane: &Plane) -> Result<String, String> {
    let nothing = || "No state of the runs can be drawn.".to_owned();
    let span = |axis: usize| Span::of(plane.values[axis].iter().copied()).ok_or_else(nothing);
    let axes = plane.states.map(|state| &page.record.system.states[state]);
    let shape = match axes[0].unit == axes[1].unit {
        true => Proportions::Equal,
        false => Proportions::Free(330.0),
    };
    let mut plot = Plot::new("paths-plane", span(0)?, span(1)?, shape);
    plot.beyond([span(0)?, span(1)?]);
    margins(&mut plot, page, plane);
    for (run, judged) in drawn(page) {
        let line = plot.line(points(run, plane.states));
        plot.path(class(judged), &line);
    }
    for (run, judged) in drawn(page) {
        let all = points(run, plane.states);
        all.first().iter().for_each(|point| plot.mark(**point, START));
        let last = all.iter().rev().find(|point| point.iter().all(|x| ordinary(*x)));
        let mark = if judged.success() { dot(4.2) } else { cross(4.0) };
        last.iter().for_each(|point| plot.mark(**point, &mark));
    }
    let [x, y] = axes.map(|axis| match axis.unit.is_empty() {
        true => axis.name.clone(),
        false => format!("{} ({})", axis.name, axis.unit),
    });
    let labels = Labels { x: &x, y: &y, whole: false };
    Ok(plot.finish(&labels, &format!("Paths of the runs: {y} against {x}")))
}

/// The target as an area, violated constraints hatched, and the zero levels of both margins.
fn margins(plot: &mut Plot, page: &PlanPage<'_>, plane: &Plane) {
    let task = &page.record.system.task;
    let field = |values: &[f64], sign: f64| Field {
        x: plane.values[0].clone(),
        y: plane.values[1].clone(),
        values: values.iter().map(|value| sign * value).collect(),
    };
    if task.has_target() {
        let target = field(&plane.target, 1.0);
        let area: String = target.region().into_iter().map(|part| plot.polygon(part)).collect();
        plot.path("target-area", &area);
        let edge: String = target.zero_lines().into_iter().map(|line| plot.line(line)).collect();
        plot.path("target", &edge);
    }
    if task.has_constraint() {
        let violated = field(&plane.constraint, -1.0);
        let area: String = violated.region().into_iter().map(|part| plot.polygon(part)).collect();
        plot.path("hatched", &area);
        let edge: String = violated.zero_lines().into_iter().map(|line| plot.line(line)).collect();
        plot.path("constraint", &edge);
    }
}

/// The places of a run in the plane.
fn points(run: &Trajectory, states: [usize; 2]) -> Vec<[f64; 2]> {
    let at = |x: &Vec<f32>| states.map(|state| x.get(state).map_or(f64::NAN, |x| f64::from(*x)));
    run.states.iter().map(at).collect()
}
