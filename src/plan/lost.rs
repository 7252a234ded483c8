//! Why a run cannot go on: which term, reference or state is not finite, and where.

use crate::model::{Costs, Model, TermKind};
use crate::real::Real;
use crate::rollout::HUGE;

/// Which reference is not finite, if one is; `context` is that of a plan.
pub(super) fn reference(costs: &Costs, context: &[f32]) -> Option<String> {
    let place = context.iter().position(|number| !number.is_finite())?;
    let reference = costs.references.get(place % costs.stage.contexts)?;
    Some(format!(
        "the reference `{}` is {} at stage {} of the plan",
        reference.name,
        context[place],
        place / costs.stage.contexts
    ))
}

/// The reason why every sample from `x` has a cost that is not finite, as the plan itself shows it.
pub(super) fn samples(model: &Model, costs: &Costs, x: &[f32], plan: &[f32], step: u32) -> String {
    let from = format!("from {}, the cost of every sample is not finite", named(model, x));
    match along(model, costs, x, plan, step) {
        Some(found) => format!("{from}: {found}"),
        None => format!(
            "{from}, though each term is along the plan itself; costs of {HUGE:e} and more count as \
             infinite, and smaller weights or less noise keep them below"
        ),
    }
}

/// The first thing along the plan from `x` that is not finite.
fn along(model: &Model, costs: &Costs, x: &[f32], plan: &[f32], step: u32) -> Option<String> {
    let mut x = x.to_vec();
    for (stage, u) in plan.chunks(model.controls.len()).enumerate() {
        let now = step + stage as u32;
        let shares = costs.shares(&x, u, now);
        let place = format!("at stage {stage} of the plan");
        if let Some(found) = term(costs, &shares, TermKind::Stage, &place, &named(model, &x)) {
            return Some(found);
        }
        let next = model.next(&x, u, now);
        if !next.iter().all(|x| x.is_finite()) {
            return Some(format!("at stage {stage} of the plan, {}", state(model, &x, &next)));
        }
        x = next;
    }
    let end = step + (plan.len() / model.controls.len()) as u32;
    let shares = costs.shares(&x, &vec![0.0; model.controls.len()], end);
    term(costs, &shares, TermKind::Terminal, "at the end of the plan", &named(model, &x))
}

/// Which term of `kind` has a share that no sample can have, if one does.
fn term(costs: &Costs, shares: &[f32], kind: TermKind, place: &str, state: &str) -> Option<String> {
    let own = shares.iter().zip(&costs.terms).filter(|(_, term)| term.kind == kind);
    let (share, term) = own.into_iter().find(|(share, _)| too_much(**share))?;
    Some(format!("the term `{}.{}` is {share} {place}, at {state}", kind.name(), term.name))
}

/// Whether a cost is none that a sample can have.
fn too_much(share: f32) -> bool {
    share.is_nan() || Real::abs(share) >= HUGE
}

/// Which state after `x` is not finite.
pub(super) fn state(model: &Model, x: &[f32], next: &[f32]) -> String {
    let lost = model.states.iter().zip(next).find(|(_, x)| !x.is_finite());
    let (name, value) = lost.map_or(("a state", f32::NAN), |(axis, x)| (axis.name.as_str(), *x));
    format!("the state after {} has {name} = {value}", named(model, x))
}

/// A state by its names.
fn named(model: &Model, x: &[f32]) -> String {
    let each = model.states.iter().zip(x).map(|(axis, x)| format!("{} {x}", axis.name));
    each.collect::<Vec<_>>().join(", ")
}
