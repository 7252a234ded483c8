//! The hierarchical controller, Algorithm 2: all races step together, each tier as one batch.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::interface::{Active, Controller, Decision, World};
use super::plan::{Networks, Paths, RacePlanner, fan, first, problem, stream};
use crate::control::mppi::{PolicyPlan, shifted};
use crate::control::tier::{Asked, Case, Certifier, Standing};
use crate::error::Result;
use crate::model::Plant;
use crate::policy::{Mlp, Policy};
use crate::race::cost::RaceReference;
use crate::race::settings::{FirstPlan, HybridSettings, RecoveryPoint};
use crate::race::system::DroneRace;
use crate::rollout::{Disturbance, MppiProblem, MppiResult, ValueTerm};
use crate::scenario::global::slice_through;
use crate::scenario::ledger::Ledger;
use crate::scenario::tier::Tier;
use crate::system::System;

/// Velocity across above which the study brakes on entering the target, m/s.
const BRAKE_FROM: f32 = 0.35;
/// Control along the gate of the study's brake.
const BRAKE_ALONG: f32 = 0.6;
/// Distance from the gate's plane within which the study flies fast, m.
const NEAR_GATE: f32 = 0.1;
/// Where the study's disturbance acts, and how much a step of it adds, m/s.
const DISTURBED: [(usize, f32); 3] = [(7, 0.01), (9, 0.01), (11, 0.01)];

/// The four tiers.
pub(in crate::race) struct Hybrid<'a> {
    world: World<'a>,
    certifier: Certifier<'a>,
    fast: RacePlanner<'a>,
    recovery: RacePlanner<'a>,
    /// What plans of the policy are rolled out with.
    planned: Plant,
    paths: Paths,
    races: Vec<Memory>,
}

/// What the controller remembers of a race.
#[derive(Clone, Debug)]
struct Memory {
    /// Whether the target was reached once.
    reached: bool,
    /// The plan of tier 0, none before its first step there.
    plan: Option<Vec<f32>>,
    ledger: Ledger,
}

impl<'a> Hybrid<'a> {
    /// The controller of `races` races.
    pub(in crate::race) fn new(world: World<'a>, races: usize, paths: Paths) -> Result<Self> {
        let asked = &world.race.hybrid;
        let HybridSettings { global, local, domain, .. } = *asked;
        let certificates = Asked { global, local, domain };
        let certifier = Certifier::new(world.program, world.certificates, certificates)?;
        let fast = RacePlanner::new("race.hybrid.fast", &asked.fast, &world, Networks::default())?;
        let networks = networks(&world);
        let recovery = RacePlanner::new("race.hybrid.recovery", &asked.recovery, &world, networks)?;
        let ego_gain = if asked.plan_gain > 0.0 { asked.plan_gain } else { world.system.ego_gain };
        let planned = Plant::of(DroneRace { ego_gain, ..*world.system }, world.policy.clone());
        let memory = Memory { reached: false, plan: None, ledger: Ledger::new(world.race.beta)? };
        let races = vec![memory; races];
        Ok(Self { world, certifier, fast, recovery, planned, paths, races })
    }

    fn settings(&self) -> &'a HybridSettings {
        &self.world.race.hybrid
    }

    /// Whether tier 0 has the race: in the target now, or once where that counts as held, or close
    /// to the gate where that counts.
    fn in_target(&mut self, race: &Active) -> bool {
        let asked = self.settings();
        let inside = self.world.system.target(race.state) > 0.0;
        let memory = &mut self.races[race.place];
        memory.reached |= inside;
        inside || (asked.latch && memory.reached) || (asked.near_gate && near_gate(&race.state))
    }

    /// Tier 0: the fast plan.
    fn fly_fast(&mut self, step: u32, races: &[Active]) -> Result<Vec<Decision>> {
        let begun = Instant::now();
        let begin = |race: &Active| self.fast_problem(step, race);
        let mut problems: Vec<MppiProblem> = races.iter().map(begin).collect();
        let results = self.fast.planner.improve(&mut problems)?;
        let mut decisions = Vec::with_capacity(races.len());
        for (number, (race, result)) in races.iter().zip(results).enumerate() {
            decisions.push(Decision {
                control: first(&result.plan),
                tier: Some(Tier::Target),
                effective_samples: Some(result.effective_samples),
                best_cost: Some(result.least_cost),
                non_finite: result.non_finite,
                fan: fan(&self.fast, &problems[number], self.paths),
                ..Decision::default()
            });
            self.races[race.place].plan = Some(result.plan);
        }
        Ok(shared(decisions, begun))
    }

    /// The fast plan of a race before it is improved.
    fn fast_problem(&self, step: u32, race: &Active) -> MppiProblem {
        let asked = self.settings();
        let horizon = self.fast.planner.horizon();
        let plan = match (&self.races[race.place].plan, asked.first_plan) {
            (Some(plan), _) => shifted(plan, 3),
            (None, FirstPlan::Zero) => vec![0.0; 3 * horizon],
            (None, FirstPlan::Brake) => vec![brake(&race.state); horizon].into_flattened(),
            (None, FirstPlan::Policy) => self.policy_plan(&race.state, horizon).controls,
        };
        let near = asked.near_gate && near_gate(&race.state);
        let speed = if near { asked.near_gate_speed } else { self.fast.speed };
        let reference = RaceReference { speed, ..RaceReference::default() };
        problem(race.state, plan, stream(race.seed, step), |_| reference)
    }

    /// A rollout of the policy with the gain and the opponent that plans start from.
    fn policy_plan(&self, start: &[f32; 12], horizon: usize) -> PolicyPlan {
        let held = self.settings().hold_opponent;
        PolicyPlan::new(&self.planned, start, horizon, |x| {
            if held {
                x[6..].copy_from_slice(&start[6..]);
            }
        })
    }

    /// The standings of the races outside of tier 0, and what each spent on them.
    fn standings(&mut self, step: u32, races: &[Active]) -> Result<(Vec<Standing>, Vec<f64>)> {
        let places: Vec<usize> = races.iter().map(|race| race.place).collect();
        let spent = |races: &[Memory], place: usize| races[place].ledger.total();
        let before: Vec<f64> = places.iter().map(|&place| spent(&self.races, place)).collect();
        let mut ledgers: Vec<Option<&mut Ledger>> =
            self.races.iter_mut().map(|memory| Some(&mut memory.ledger)).collect();
        let mut cases = Vec::with_capacity(races.len());
        for race in races {
            let ledger = ledgers[race.place].take().expect("a race has one place");
            cases.push(Case { state: race.state.to_vec(), seed: race.seed, step, ledger });
        }
        let standings = self.certifier.standings(&mut cases)?;
        drop(cases);
        let after = places.iter().map(|&place| spent(&self.races, place));
        Ok((standings, after.zip(before).map(|(after, before)| after - before).collect()))
    }

    /// Tiers 1 and 2, and 3 where it is left out: the policy.
    fn fly_policy(&self, race: &Active) -> [f32; 3] {
        self.world.policy.control(race.state).map(|u| u.clamp(-1.0, 1.0))
    }

    /// Tier 3: recovery toward the nearest verified point.
    fn recover(
        &self,
        step: u32,
        races: &[(Active, &Standing)],
    ) -> Result<Vec<(Decision, [f32; 3])>> {
        let horizon = self.recovery.planner.horizon();
        let begin = |(race, standing): &(Active, &Standing)| {
            let PolicyPlan { controls, states } = self.policy_plan(&race.state, horizon);
            let point = self.recovery_point(&race.state, standing, &states);
            let reference = |t: usize| RaceReference {
                position: point,
                velocity: [states[t][1], states[t][3], states[t][5]],
                speed: self.recovery.speed,
                last: false,
            };
            (problem(race.state, controls, stream(race.seed, step), reference), point)
        };
        let begun: Vec<_> = races.par_iter().map(begin).collect();
        let (mut problems, points): (Vec<_>, Vec<_>) = begun.into_iter().unzip();
        let results = self.recovery.planner.improve(&mut problems)?;
        let decide = |(number, result): (usize, MppiResult)| Decision {
            control: first(&result.plan),
            effective_samples: Some(result.effective_samples),
            best_cost: Some(result.least_cost),
            non_finite: result.non_finite,
            fan: fan(&self.recovery, &problems[number], self.paths),
            ..Decision::default()
        };
        Ok(results.into_iter().enumerate().map(decide).zip(points).collect())
    }

    /// Where recovery steers to from `x`, at the height that the ego has.
    fn recovery_point(&self, x: &[f32; 12], standing: &Standing, planned: &[Vec<f32>]) -> [f32; 3] {
        let gate = [0.0, 0.0, x[4]];
        match self.settings().recovery_point {
            RecoveryPoint::Gate => gate,
            RecoveryPoint::Policy => planned.last().map_or(gate, |x| [x[0], x[2], x[4]]),
            RecoveryPoint::Verified => {
                let verified = standing.growth.as_ref().filter(|growth| growth.verified);
                let ball = verified.map(|growth| {
                    let center = &growth.ball.center;
                    nearest_in_disc(x, [center[0], center[2]], growth.ball.radius)
                });
                let cell = || nearest_cell(&self.cells(x, standing), x);
                ball.or_else(cell).map_or(gate, |[px, py]| [px, py, x[4]])
            }
        }
    }

    /// The certified cells of the slice through `x`.
    fn cells(&self, x: &[f32; 12], standing: &Standing) -> Vec<[f32; 2]> {
        let states = slice_through(self.certifier.settings(), x);
        let certified = states.iter().zip(&standing.certified).filter(|(_, certified)| **certified);
        certified.map(|(x, _)| [x[0], x[2]]).collect()
    }
}

impl Controller for Hybrid<'_> {
    fn decide(&mut self, step: u32, active: &[Active]) -> Result<Vec<Decision>> {
        let mut decisions = vec![Decision::default(); active.len()];
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..active.len()).partition(|&i| self.in_target(&active[i]));
        let fast: Vec<Active> = inside.iter().map(|&i| active[i]).collect();
        for (i, decision) in inside.into_iter().zip(self.fly_fast(step, &fast)?) {
            decisions[i] = decision;
        }
        let rest: Vec<Active> = outside.iter().map(|&i| active[i]).collect();
        for (i, decision) in outside.into_iter().zip(self.decide_outside(step, &rest)?) {
            decisions[i] = decision;
        }
        Ok(decisions)
    }
}

impl Hybrid<'_> {
    /// The decisions of the races outside of tier 0.
    fn decide_outside(&mut self, step: u32, races: &[Active]) -> Result<Vec<Decision>> {
        let begun = Instant::now();
        let (standings, spent) = self.standings(step, races)?;
        let recovers =
            |standing: &Standing| standing.tier == Tier::Recovery && self.settings().recovery_tier;
        let lost: Vec<(Active, &Standing)> = races
            .iter()
            .zip(&standings)
            .filter(|(_, standing)| recovers(standing))
            .map(|(race, standing)| (*race, standing))
            .collect();
        let mut recovered = self.recover(step, &lost)?.into_iter();
        let mut decisions = Vec::with_capacity(races.len());
        for ((race, standing), beta) in races.iter().zip(&standings).zip(spent) {
            let (mut decision, point) = match recovers(standing).then(|| recovered.next()).flatten()
            {
                Some((decision, point)) => (decision, Some(point)),
                None => {
                    let control = self.fly_policy(race);
                    (Decision { control, ..Decision::default() }, None)
                }
            };
            decision.tier = Some(standing.tier);
            decision.check_margin = Some(standing.check_margin);
            decision.growth.clone_from(&standing.growth);
            decision.certified.clone_from(&standing.certified);
            decision.recovery = point;
            decision.beta = beta;
            decision.refused = standing.refused;
            decisions.push(decision);
        }
        Ok(shared(decisions, begun))
    }
}

/// The networks that take part in the recovery of `world`.
fn networks(world: &World<'_>) -> Networks {
    let asked = &world.race.hybrid;
    let (weight, threshold) = (asked.value_weight, asked.value_threshold);
    let shared = |network: &Mlp| Arc::new(network.clone());
    let value = world.value.filter(|_| weight > 0.0).map(shared);
    let entries = DISTURBED.to_vec();
    Networks {
        value: value.map(|network| ValueTerm { network, weight, threshold }),
        disturbance: world.disturbance.map(shared).map(|network| Disturbance { network, entries }),
    }
}

/// Gives each decision its share of the time since `begun`.
pub(in crate::race) fn shared(mut decisions: Vec<Decision>, begun: Instant) -> Vec<Decision> {
    let share = begun.elapsed().as_secs_f64() / decisions.len().max(1) as f64;
    decisions.iter_mut().for_each(|decision| decision.seconds = share);
    decisions
}

/// Whether the study counts `x` as close to the gate.
pub(in crate::race) fn near_gate(x: &[f32; 12]) -> bool {
    x[2].abs() <= NEAR_GATE && x[0].abs() <= DroneRace::GATE
}

/// The study's control on entering the target.
fn brake(x: &[f32; 12]) -> [f32; 3] {
    if x[1].abs() > BRAKE_FROM {
        [-x[1].signum(), -BRAKE_ALONG * x[3].signum(), 0.0]
    } else {
        [0.0; 3]
    }
}

/// The point of the disc that is nearest to `x`, in the plane.
fn nearest_in_disc(x: &[f32; 12], [cx, cy]: [f32; 2], radius: f32) -> [f32; 2] {
    let (dx, dy) = (x[0] - cx, x[2] - cy);
    let distance = dx.hypot(dy);
    if distance <= radius {
        return [x[0], x[2]];
    }
    [cx + dx * radius / distance, cy + dy * radius / distance]
}

/// The cell that is nearest to `x`, in the plane.
fn nearest_cell(cells: &[[f32; 2]], x: &[f32; 12]) -> Option<[f32; 2]> {
    let distance = |cell: &[f32; 2]| (cell[0] - x[0]).hypot(cell[1] - x[2]);
    cells.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

#[cfg(test)]
mod tests;
