//! Why no start is certified: what the bound takes off the margins beside what they are, and what to try.

use super::drops_record::{DropsRecord, WidestRecord};
use super::record::{DeviationRecord, PictureRecord, Record};
use super::tightened::tightening;
use crate::model::{Form, Model, Role};
use crate::rollout::{HUGE, PairControl, RolloutSpec};
use crate::rounding::{number, upper};

/// Why the certified set is empty, a sentence each.
///
/// The margins are those of the pictured rollouts, which say what the plant is like and claim nothing.
pub(super) fn reasons(model: &Model, record: &Record, spec: &RolloutSpec) -> Vec<String> {
    let Record { deviation, constants, drops, picture, .. } = record;
    let seen = Seen::of(model, picture);
    let losses = match drops {
        Some(drops) => drops.shapes().tightening(drops.level),
        None => tightening(&deviation.bound, constants, spec),
    };
    let mut reasons = vec![match drops {
        Some(drops) => level(drops),
        None => distances(deviation),
    }];
    let sees = |sees: fn(Role) -> bool| {
        let roles = model.task.roles(spec.horizon);
        roles.into_iter().map(sees).collect::<Vec<bool>>()
    };
    let target = least_lost("target", &seen.target, &losses.target, &sees(Role::sees_target));
    let constraint = sees(Role::sees_constraint);
    let constraint = least_lost("constraint", &seen.constraint, &losses.constraint, &constraint);
    reasons.extend(target);
    reasons.extend(constraint);
    reasons.extend(if drops.is_none() { set_by(deviation) } else { None });
    reasons.push(remedies(deviation, &seen, &model.task.short_words(Form::One, spec.horizon)));
    reasons
}

/// The largest margins that pictured rollouts have at each step.
struct Seen {
    /// Of the target.
    target: Vec<f64>,
    /// Of the constraint.
    constraint: Vec<f64>,
    /// Whether any of them succeeds.
    success: bool,
    /// How many there are.
    count: usize,
}

impl Seen {
    fn of(model: &Model, picture: &PictureRecord) -> Self {
        let rollouts = &picture.rollouts;
        let longest = rollouts.iter().map(|rollout| rollout.states.len()).max().unwrap_or(0);
        let whole = |x: &&Vec<f32>| x.len() == model.states.len();
        let largest = |margin: &dyn Fn(&[f64], u32) -> f64| {
            let at = |step: usize| {
                let states = rollouts.iter().filter_map(|rollout| rollout.states.get(step));
                let wide = |x: &Vec<f32>| x.iter().copied().map(f64::from).collect::<Vec<f64>>();
                let margins = states.filter(whole).map(|x| margin(&wide(x), step as u32));
                margins.fold(f64::NEG_INFINITY, f64::max)
            };
            (0..longest).map(at).collect()
        };
        Self {
            target: largest(&|x, step| model.target_at(x, step)),
            constraint: largest(&|x, step| model.constraint_at(x, step)),
            success: rollouts.iter().any(|rollout| rollout.success),
            count: rollouts.len(),
        }
    }
}

/// The bound on margin drops, and the pair and step that set it.
fn level(drops: &DropsRecord) -> String {
    let mut text = format!(
        "No start is certified: margins may drop by {} times their shapes",
        upper(drops.level)
    );
    if let Some(widest) = &drops.widest {
        let WidestRecord { pair, step, margin } = widest;
        text += &format!(
            "; the largest drop is that of the {margin} margin of pair {pair} at step {step}"
        );
    }
    text + "."
}

/// The bound beside the largest distance that was seen.
fn distances(deviation: &DeviationRecord) -> String {
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let (bound, largest) = (most(&deviation.bound), most(&deviation.largest));
    if bound >= f64::from(HUGE) {
        return "No start is certified: the deviation bound is beyond every margin.".to_owned();
    }
    format!(
        "No start is certified: the deviation bound goes up to {}, the largest distance seen up to {}.",
        upper(bound),
        upper(largest)
    )
}

/// The step among those at which a margin counts where the bound leaves most of it, if that is nothing.
fn least_lost(name: &str, margins: &[f64], losses: &[f32], counts: &[bool]) -> Option<String> {
    let left = |(margin, loss): (&f64, &f32)| margin - f64::from(*loss);
    let steps = margins.iter().zip(losses).enumerate().filter(|(step, _)| counts[*step]);
    let (step, (margin, loss)) = steps.max_by(|a, b| left(a.1).total_cmp(&left(b.1)))?;
    (left((margin, loss)) <= 0.0).then(|| {
        format!(
            "At no step is anything left of the {name} margin: at step {step}, where least is missing, the \
             largest of the pictured rollouts is {}, and the bound takes off {}.",
            number(*margin),
            upper(f64::from(*loss))
        )
    })
}

/// The step that set the one scale of the shape.
fn set_by(deviation: &DeviationRecord) -> Option<String> {
    let scale = deviation.scale?;
    let share = |step: usize| deviation.largest[step] / deviation.bound[step];
    let steps = 1..deviation.bound.len().min(deviation.largest.len());
    let step = steps.max_by(|a, b| share(*a).total_cmp(&share(*b)))?;
    Some(format!(
        "The scale {} was set at step {step}, where a pair was {} apart and the pilot {}: all other steps \
         are scaled with it.",
        upper(scale),
        upper(deviation.largest[step]),
        number(deviation.bound[step] / scale)
    ))
}

/// What may help; `deed` is what a rollout that succeeds does.
fn remedies(deviation: &DeviationRecord, seen: &Seen, deed: &str) -> String {
    if !seen.success && seen.count > 0 {
        return format!(
            "None of the {} pictured rollouts {deed}: it is the policy, the horizon or \
             the box that falls short, not the bound.",
            seen.count
        );
    }
    let feedback = match deviation.control {
        PairControl::Replay => {
            ", or the policy in feedback (`deviation.control = \"closed-loop\"`)"
        }
        PairControl::ClosedLoop => "",
    };
    format!(
        "What may help: a smaller perturbation (`deviation.radius`, {} here){feedback}, a smaller box.",
        number(deviation.radius)
    )
}
