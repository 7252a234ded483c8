//! The controllers without tiers: MPPI, the policy, and either before the barrier filter.

use std::time::Instant;

use rayon::prelude::*;

use super::interface::{Active, Controller, Decision, FilterLog, World};
use super::plan::{Networks, Paths, RacePlanner, fan, first, problem, stream};
use crate::control::mppi::{PolicyPlan, shifted};
use crate::error::Result;
use crate::policy::{Mlp, Policy};
use crate::race::barrier::{BarrierFilter, Filtered};
use crate::race::cost::RaceReference;
use crate::race::settings::PlanSettings;
use crate::race::system::DroneRace;

/// A policy, with or without the filter.
pub(in crate::race) struct PolicyController<'a> {
    policy: &'a Mlp,
    filter: Option<(BarrierFilter, &'a DroneRace)>,
}

impl<'a> PolicyController<'a> {
    /// `policy` alone.
    pub(in crate::race) fn new(policy: &'a Mlp) -> Self {
        Self { policy, filter: None }
    }

    /// `policy` before the filter of the race.
    pub(in crate::race) fn filtered(world: World<'a>, policy: &'a Mlp) -> Result<Self> {
        let filter = world.race.filter.filter()?;
        Ok(Self { policy, filter: Some((filter, world.system)) })
    }
}

impl Controller for PolicyController<'_> {
    fn decide(&mut self, _step: u32, active: &[Active]) -> Result<Vec<Decision>> {
        let decide = |race: &Active| {
            let begun = Instant::now();
            let control = self.policy.control(race.state).map(|u| u.clamp(-1.0, 1.0));
            let mut decision = Decision { control, ..Decision::default() };
            if let Some((filter, system)) = &self.filter {
                filtered(filter, system, race, &mut decision);
            }
            decision.seconds = begun.elapsed().as_secs_f64();
            decision
        };
        Ok(active.iter().map(decide).collect())
    }
}

/// Passes the control of `decision` through the filter.
fn filtered(filter: &BarrierFilter, system: &DroneRace, race: &Active, decision: &mut Decision) {
    let Filtered { control, slack, status } = filter.filter(system, &race.state, decision.control);
    let change = control.iter().zip(decision.control).map(|(a, b)| (a - b).abs());
    let active = change.fold(0.0, f32::max) > 1e-6;
    decision.control = control;
    decision.filter = Some(FilterLog { status, slack, active });
}

/// MPPI, with or without the filter, with or without a warm start.
pub(in crate::race) struct MppiController<'a> {
    world: World<'a>,
    plan: RacePlanner<'a>,
    filter: Option<BarrierFilter>,
    warm: bool,
    paths: Paths,
    /// The plan of each race, none before its first step.
    plans: Vec<Option<Vec<f32>>>,
}

impl<'a> MppiController<'a> {
    /// MPPI by the `settings` of `section` for `races` races.
    pub(in crate::race) fn new(
        world: World<'a>,
        section: &str,
        settings: &PlanSettings,
        races: usize,
        paths: Paths,
    ) -> Result<Self> {
        let plan = RacePlanner::new(section, settings, &world, Networks::default())?;
        Ok(Self { world, plan, filter: None, warm: false, paths, plans: vec![None; races] })
    }

    /// The same before the filter.
    pub(in crate::race) fn with_filter(mut self) -> Result<Self> {
        self.filter = Some(self.world.race.filter.filter()?);
        Ok(self)
    }

    /// The same with each plan started from a rollout of the policy at every step.
    pub(in crate::race) fn warm_started(mut self) -> Self {
        self.warm = true;
        self
    }

    /// The plan to improve at `race`.
    fn start_plan(&self, race: &Active) -> Vec<f32> {
        let horizon = self.plan.planner.horizon();
        match &self.plans[race.place] {
            _ if self.warm => {
                let plant = self.world.program.plant();
                PolicyPlan::new(plant, &race.state, horizon, |_| {}).controls
            }
            Some(plan) => shifted(plan, 3),
            None => vec![0.0; 3 * horizon],
        }
    }
}

impl Controller for MppiController<'_> {
    fn decide(&mut self, step: u32, active: &[Active]) -> Result<Vec<Decision>> {
        let begun = Instant::now();
        let reference = RaceReference { speed: self.plan.speed, ..RaceReference::default() };
        let begin = |race: &Active| {
            problem(race.state, self.start_plan(race), stream(race.seed, step), |_| reference)
        };
        let mut problems: Vec<_> = active.par_iter().map(begin).collect();
        let results = self.plan.planner.improve(&mut problems)?;
        let mut decisions = Vec::with_capacity(active.len());
        for (number, (race, result)) in active.iter().zip(results).enumerate() {
            let mut decision = Decision {
                control: first(&result.plan),
                effective_samples: Some(result.effective_samples),
                best_cost: Some(result.least_cost),
                non_finite: result.non_finite,
                fan: fan(&self.plan, &problems[number], self.paths),
                ..Decision::default()
            };
            if let Some(filter) = &self.filter {
                filtered(filter, self.world.system, race, &mut decision);
            }
            self.plans[race.place] = Some(result.plan);
            decisions.push(decision);
        }
        let share = begun.elapsed().as_secs_f64() / active.len().max(1) as f64;
        decisions.iter_mut().for_each(|decision| decision.seconds = share);
        Ok(decisions)
    }
}
