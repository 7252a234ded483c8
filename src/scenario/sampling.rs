//! What the states looked at do not tell: what lies between two of them, and motion below their spacing.

use crate::model::Plant;
use crate::rollout::{States, replay};
use crate::rounding::{lower, number, upper};
use crate::system::{Axis, Body, Feature};

/// Share of the longest step of a coordinate from which on the spacing of its numbers is told.
const SHARE: f64 = 0.01;

/// What is to be said of rollouts from `starts`: that nothing is looked at between samples, or between the points
/// of a period, with the farthest that something moves from one to the next, and where f32 loses the motion.
pub fn sampling(plant: &Plant, starts: States<'_>, horizon: u32) -> Vec<String> {
    let model = &plant.model;
    let roll = |start: &[f32]| replay::looks::<f64>(plant, start, horizon);
    let rollouts: Vec<Vec<Vec<f64>>> = starts.iter().map(roll).collect();
    let moved = farthest(&model.states, &model.bodies, &rollouts);
    let looked = Looked::of(model.points);
    let between = between(looked, rollouts.len(), moved, model.smallest_feature.clone());
    std::iter::once(between).chain(lost(&model.states, &rollouts)).collect()
}

/// Where states are looked at, in words.
struct Looked {
    /// The places.
    places: String,
    /// The way from one to the next.
    way: &'static str,
    /// That a feature may be missed, and what to do about it.
    leap: &'static str,
}

impl Looked {
    /// Where a period has `points` parts.
    fn of(points: u32) -> Self {
        match points {
            1 => Self {
                places: "only at the samples".to_owned(),
                way: "in a step",
                leap: "A step can leap over it unseen: shorten the step of the system, or the speeds.",
            },
            _ => Self {
                places: format!("at the samples and {}", points_between(points - 1)),
                way: "from one to the next",
                leap: "It can be leapt over unseen between two of them: look at more points of each period \
                       (`between`), or shorten the period, or the speeds.",
            },
        }
    }
}

/// `at 3 further points of each period`.
pub(crate) fn points_between(between: u32) -> String {
    let points = if between == 1 { "point" } else { "points" };
    format!("at {between} further {points} of each period")
}

/// Where rollouts are looked at, beside what is known of the way between and of features.
fn between(
    Looked { places, way, leap }: Looked,
    count: usize,
    moved: Option<Moved>,
    feature: Option<Feature>,
) -> String {
    let mut text = format!(
        "States are looked at {places}, and nothing is said of what lies between two of them"
    );
    if let Some(Moved { what, step }) = &moved {
        let step = upper(*step);
        text += &format!("; in {count} rollouts, {what} moves up to {step} m {way}");
    }
    if let Some(Feature { name, width }) = &feature {
        let wide = lower(f64::from(*width));
        text += &format!(", and the smallest feature, {name}, is {wide} m wide");
    }
    text.push('.');
    match (moved, feature) {
        (Some(moved), Some(feature)) if moved.step > f64::from(feature.width) => text + " " + leap,
        _ => text,
    }
}

/// The longest way from one look to the next.
#[derive(Clone, Debug, PartialEq)]
struct Moved {
    /// What moved so far.
    what: String,
    /// How far, m.
    step: f64,
}

/// The farthest that a body moves from one look to the next; without bodies, a coordinate in metres.
fn farthest(axes: &[Axis], bodies: &[Body], rollouts: &[Vec<Vec<f64>>]) -> Option<Moved> {
    let plane = |body: &Body| (format!("the {}", body.name), vec![body.x, body.y]);
    let mut parts: Vec<(String, Vec<usize>)> = bodies.iter().map(plane).collect();
    if parts.is_empty() {
        let metres = axes.iter().enumerate().filter(|(_, axis)| axis.unit == "m");
        parts = metres.map(|(i, axis)| (axis.name.clone(), vec![i])).collect();
    }
    let far = |coordinates: &[usize]| {
        let length = |[a, b]: [&Vec<f64>; 2]| {
            coordinates.iter().map(|&i| (b[i] - a[i]).powi(2)).sum::<f64>().sqrt()
        };
        steps(rollouts).map(length).filter(|step| step.is_finite()).fold(0.0, f64::max)
    };
    let moved = parts.into_iter().map(|(what, parts)| Moved { what, step: far(&parts) });
    moved.max_by(|a, b| a.step.total_cmp(&b.step))
}

/// Every state with the next one.
fn steps(rollouts: &[Vec<Vec<f64>>]) -> impl Iterator<Item = [&Vec<f64>; 2]> {
    rollouts.iter().flat_map(|states| states.windows(2).map(|pair| [&pair[0], &pair[1]]))
}

/// The coordinate whose numbers in f32 lie farthest apart beside its longest step, where that is
/// more than a hundredth.
fn lost(axes: &[Axis], rollouts: &[Vec<Vec<f64>>]) -> Option<String> {
    let coarse = |i: usize| {
        let (mut step, mut most) = (0.0_f64, 0.0_f64);
        for [a, b] in steps(rollouts) {
            // A rollout that ran away says nothing of the others.
            if a[i].is_finite() && b[i].is_finite() {
                step = step.max((b[i] - a[i]).abs());
                most = most.max(a[i].abs());
            }
        }
        (i, most, spacing(most), step)
    };
    let shares = (0..axes.len()).map(coarse).filter(|&(_, _, spacing, step)| {
        // What stands still loses nothing.
        step > 0.0 && spacing > SHARE * step
    });
    let worst = shares.max_by(|a, b| (a.2 / a.3).total_cmp(&(b.2 / b.3)));
    worst.map(|(i, most, spacing, step)| {
        let Axis { name, unit, .. } = &axes[i];
        format!(
            "CAUTION: around {name} = {} {unit} numbers of f32 lie {} apart, {} % of the longest step \
             of {name} ({}), and what is smaller is lost; give coordinates relative to an origin \
             nearby.",
            number(most),
            upper(spacing),
            upper(100.0 * spacing / step),
            number(step)
        )
    })
}

/// Distance from `value` to the next larger f32.
pub(crate) fn spacing(value: f64) -> f64 {
    let single = value.abs() as f32;
    f64::from(single.next_up()) - f64::from(single)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::{BangBang, DoubleIntegrator};

    fn said(starts: &[[f32; 2]], target: f32) -> Vec<String> {
        let system = DoubleIntegrator { target, ..DoubleIntegrator::default() };
        let plant = Plant::of(system, BangBang { acceleration: 1.0 });
        sampling(&plant, States::from(starts), 30)
    }

    #[test]
    fn the_longest_step_stands_beside_the_smallest_feature() {
        // From 1.5 m/s away from the origin the mass slows down: its first step, 0.15 m, is the longest.
        let text = said(&[[0.1, 1.5]], 0.25);
        assert_eq!(text.len(), 1, "{text:?}");
        for words in ["only at the samples", "position moves up to 0.1501 m", "is 0.5 m wide."] {
            assert!(text[0].contains(words), "{words}: {}", text[0]);
        }
        assert!(!text[0].contains("leap over"), "{}", text[0]);
        let thin = said(&[[0.1, 1.5]], 0.05);
        assert!(thin[0].contains("leap over"), "{}", thin[0]);
    }

    #[test]
    fn motion_below_the_spacing_is_told_with_its_figure() {
        assert_eq!(said(&[[1000.0, 0.5]], 0.25).len(), 1);
        let far = said(&[[1e5, 0.5]], 0.25);
        assert!(far[1].contains("position = 100000 m"), "{}", far[1]);
        assert!(far[1].contains("lie 0.007813 apart"), "{}", far[1]);
        assert!(far[1].contains("relative to an origin"), "{}", far[1]);
        // Velocity stays below the acceleration of 3 s: it is nowhere near.
        assert!(!far[1].contains("velocity"), "{}", far[1]);
    }

    #[test]
    fn spacings_are_those_of_f32() {
        assert_eq!(spacing(1.0), f64::from(f32::EPSILON));
        assert_eq!(spacing(2e7), 2.0);
        assert_eq!(spacing(-1.5), f64::from(f32::EPSILON));
    }
}
