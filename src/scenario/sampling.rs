//! What states at samples do not tell: what lies between two of them, and motion below their spacing.

use crate::model::Plant;
use crate::rollout::{States, replay};
use crate::rounding::{lower, number, upper};
use crate::system::{Axis, Body, Feature};

/// Share of the longest step of a coordinate from which on the spacing of its numbers is told.
const SHARE: f64 = 0.01;

/// What is to be said of rollouts from `starts`: that nothing is looked at between samples, with the
/// farthest that something moves within a step, and where f32 loses the motion.
pub fn sampling(plant: &Plant, starts: States<'_>, horizon: u32) -> Vec<String> {
    let model = &plant.model;
    let roll = |start: &[f32]| replay::states::<f64>(plant, start, horizon);
    let rollouts: Vec<Vec<Vec<f64>>> = starts.iter().map(roll).collect();
    let moved = farthest(&model.states, &model.bodies, &rollouts);
    let between = between(rollouts.len(), moved, model.smallest_feature.clone());
    std::iter::once(between).chain(lost(&model.states, &rollouts)).collect()
}

/// That rollouts are looked at at their samples alone, beside what is known of steps and features.
fn between(count: usize, moved: Option<Moved>, feature: Option<Feature>) -> String {
    let mut text =
        "States are looked at only at the samples, and nothing is said of what lies between two of them"
            .to_owned();
    if let Some(Moved { what, step }) = &moved {
        let step = upper(*step);
        text += &format!("; in {count} rollouts, {what} moves up to {step} m in a step");
    }
    if let Some(Feature { name, width }) = &feature {
        let wide = lower(f64::from(*width));
        text += &format!(", and the smallest feature, {name}, is {wide} m wide");
    }
    text.push('.');
    match (moved, feature) {
        (Some(moved), Some(feature)) if moved.step > f64::from(feature.width) => {
            text + " A step can leap over it unseen: shorten the step of the system, or the speeds."
        }
        _ => text,
    }
}

/// The longest way within a step.
#[derive(Clone, Debug, PartialEq)]
struct Moved {
    /// What moved so far.
    what: String,
    /// How far, m.
    step: f64,
}

/// The farthest that a body moves in a step; without bodies, a coordinate in metres.
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
