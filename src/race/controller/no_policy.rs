//! The ablation of the hybrid: two plans, in the target and outside, without policy and certificates.

use std::time::Instant;

use super::hybrid::{near_gate, shared};
use super::interface::{Active, Controller, Decision, World};
use super::plan::{Networks, Paths, RacePlanner, fan, first, problem, stream};
use crate::control::mppi::shifted;
use crate::error::Result;
use crate::race::cost::RaceReference;
use crate::rollout::MppiProblem;
use crate::scenario::tier::Tier;
use crate::system::System;

/// The hybrid without policy and certificates: two plans, in the target and outside.
pub(in crate::race) struct NoPolicy<'a> {
    world: World<'a>,
    fast: RacePlanner<'a>,
    outside: RacePlanner<'a>,
    paths: Paths,
    /// Whether the target was reached once, and the last plan.
    races: Vec<(bool, Option<Vec<f32>>)>,
}

impl<'a> NoPolicy<'a> {
    /// The controller of `races` races.
    pub(in crate::race) fn new(world: World<'a>, races: usize, paths: Paths) -> Result<Self> {
        let asked = &world.race.no_policy;
        let plan = |key: &str, asked| RacePlanner::new(key, asked, &world, Networks::default());
        Ok(Self {
            world,
            fast: plan("race.no_policy.fast", &asked.fast)?,
            outside: plan("race.no_policy.recovery", &asked.recovery)?,
            paths,
            races: vec![(false, None); races],
        })
    }

    /// Whether the fast plan has the race, as in the hybrid.
    fn in_target(&mut self, race: &Active) -> bool {
        let asked = &self.world.race.hybrid;
        let inside = self.world.system.target(race.state) > 0.0;
        let reached = &mut self.races[race.place].0;
        *reached |= inside;
        inside || (asked.latch && *reached) || (asked.near_gate && near_gate(&race.state))
    }

    /// One batch under one of the plans.
    fn fly(&mut self, step: u32, races: &[Active], tier: Tier) -> Result<Vec<Decision>> {
        let begun = Instant::now();
        let plan = if tier == Tier::Target { &self.fast } else { &self.outside };
        let horizon = plan.planner.horizon();
        let reference = RaceReference { speed: plan.speed, ..RaceReference::default() };
        let begin = |race: &Active| {
            let before = self.races[race.place].1.as_deref();
            let mut start = before.map_or_else(Vec::new, |plan| shifted(plan, 3));
            // The two plans may be of different length.
            start.resize(3 * horizon, 0.0);
            problem(race.state, start, stream(race.seed, step), |_| reference)
        };
        let mut problems: Vec<MppiProblem> = races.iter().map(begin).collect();
        let results = plan.planner.improve(&mut problems)?;
        let mut decisions = Vec::with_capacity(races.len());
        for (number, (race, result)) in races.iter().zip(results).enumerate() {
            decisions.push(Decision {
                control: first(&result.plan),
                tier: Some(tier),
                effective_samples: Some(result.effective_samples),
                best_cost: Some(result.least_cost),
                non_finite: result.non_finite,
                fan: fan(plan, &problems[number], self.paths),
                ..Decision::default()
            });
            self.races[race.place].1 = Some(result.plan);
        }
        Ok(shared(decisions, begun))
    }
}

impl Controller for NoPolicy<'_> {
    fn decide(&mut self, step: u32, active: &[Active]) -> Result<Vec<Decision>> {
        let mut decisions = vec![Decision::default(); active.len()];
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..active.len()).partition(|&i| self.in_target(&active[i]));
        for (places, tier) in [(inside, Tier::Target), (outside, Tier::Recovery)] {
            let races: Vec<Active> = places.iter().map(|&i| active[i]).collect();
            for (i, decision) in places.into_iter().zip(self.fly(step, &races, tier)?) {
                decisions[i] = decision;
            }
        }
        Ok(decisions)
    }
}
