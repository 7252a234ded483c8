//! What a tally is of: tallies of different plans are not put together.

use std::sync::Arc;

use super::planning::{CostQuery, Disturbance, MppiProblem, MppiTask, Planning, ValueTerm};
use crate::error::{Error, Result};

/// What the samples of a tally are of. Two backends, or two programs of the same planning, are no
/// difference.
#[derive(Clone, Debug)]
pub(crate) struct Origin {
    planning: Arc<Planning>,
    problem: MppiProblem,
    iteration: u32,
    costs: CostQuery,
}

impl Origin {
    /// That of the tally of `problem`, which is one of those of `task`.
    pub(crate) fn new(
        planning: &Arc<Planning>,
        task: &MppiTask<'_>,
        problem: &MppiProblem,
    ) -> Self {
        let &MppiTask { iteration, costs, .. } = task;
        Self { planning: Arc::clone(planning), problem: problem.clone(), iteration, costs }
    }

    /// Refuses samples of something else.
    ///
    /// # Errors
    /// [`Error::Invalid`] saying what differs.
    pub(super) fn check_same(&self, other: &Self) -> Result<()> {
        self.check(&other.planning, &other.problem)?;
        if self.iteration != other.iteration {
            let iterations = [self.iteration, other.iteration];
            let text = format!("of the iterations {} and {}", iterations[0], iterations[1]);
            return Err(differs(text + "; each has noise of its own"));
        }
        if self.costs != other.costs {
            return Err(differs("one with the cost of each sample, one without".to_owned()));
        }
        Ok(())
    }

    /// Refuses plans and a problem that the samples are not of.
    ///
    /// # Errors
    /// [`Error::Invalid`] saying what differs.
    pub(super) fn check(&self, planning: &Arc<Planning>, problem: &MppiProblem) -> Result<()> {
        let same = Arc::ptr_eq(&self.planning, planning);
        let part = (!same).then(|| different(&self.planning, planning)).flatten();
        if let Some(part) = part {
            return Err(differs(format!("of two programs: another {part}")));
        }
        match different_problem(&self.problem, problem) {
            Some(part) => Err(differs(format!("of two problems: another {part}"))),
            None => Ok(()),
        }
    }
}

fn differs(what: String) -> Error {
    let remedy = "samples are put together where all of it is the same";
    Error::invalid("tally", format!("{what}; {remedy}"))
}

/// The first part in which two plannings differ.
fn different(one: &Planning, other: &Planning) -> Option<&'static str> {
    let sizes = |plans: &Planning| [plans.model.states.len(), plans.model.controls.len()];
    let models = [&one.model, &other.model];
    let [model, period] = [
        models[0].step != models[1].step || models[0].parameters != models[1].parameters,
        models[0].period != models[1].period,
    ];
    let costs = [&one.cost, &other.cost];
    let cost = costs[0].stage != costs[1].stage
        || costs[0].map != costs[1].map
        || costs[0].lookups != costs[1].lookups
        || costs[0].terminal != costs[1].terminal;
    let settings = [one.spec.settings(), other.spec.settings()];
    [
        ("model", model || period || sizes(one) != sizes(other)),
        ("cost", cost || costs[0].contexts != costs[1].contexts),
        ("horizon", settings[0].horizon != settings[1].horizon),
        ("specification of the samples", one.spec != other.spec),
        ("value network", !same_value(one.value.as_ref(), other.value.as_ref())),
        ("disturbance", !same_disturbance(one.disturbance.as_ref(), other.disturbance.as_ref())),
    ]
    .into_iter()
    .find_map(|(part, differs)| differs.then_some(part))
}

fn same_value(one: Option<&ValueTerm>, other: Option<&ValueTerm>) -> bool {
    let numbers = |term: &ValueTerm| [term.weight, term.threshold];
    match (one, other) {
        (Some(one), Some(other)) => numbers(one) == numbers(other) && one.network == other.network,
        (one, other) => one.is_none() && other.is_none(),
    }
}

fn same_disturbance(one: Option<&Disturbance>, other: Option<&Disturbance>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => one.entries == other.entries && one.network == other.network,
        (one, other) => one.is_none() && other.is_none(),
    }
}

/// The first part in which two problems differ.
fn different_problem(one: &MppiProblem, other: &MppiProblem) -> Option<&'static str> {
    [
        ("start", one.start != other.start),
        ("plan", one.plan != other.plan),
        ("context", one.context != other.context),
        ("first step", one.first_step != other.first_step),
        ("stream", one.stream != other.stream),
    ]
    .into_iter()
    .find_map(|(part, differs)| differs.then_some(part))
}

impl PartialEq for Origin {
    fn eq(&self, other: &Self) -> bool {
        self.check_same(other).is_ok()
    }
}
