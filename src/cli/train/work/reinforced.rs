//! Training by reinforcement.

use super::Training;
use crate::error::Result;
use crate::model::Plant;
use crate::system::System;
use crate::train::analytic::Task;
use crate::train::ddpg::{Ddpg, Game};
use crate::train::ppo::{Lesson, Ppo};
use crate::train::reward::Reward;
use crate::train::run::Trained;

impl Training<'_> {
    /// Control, disturbance and critic of `system`.
    pub(super) fn ddpg<S, const NX: usize, const NU: usize>(self, system: &S) -> Result<Trained>
    where
        S: System<NX, NU>,
    {
        let game = Game {
            entries: self.config.disturbed(&system.states())?,
            states: self.intervals(system)?,
            hidden: self.settings.hidden.clone(),
        };
        let settings = &self.settings.ddpg;
        let mut learner = Ddpg::new(self.task(system)?, game, settings.clone());
        let [policy, ..] = &learner.exported()?;
        let program = self.backend.prepare(&Plant::recorded(system, policy))?;
        self.train(&mut learner, settings.iterations, &program)
    }

    /// A policy of `system` on its ordinary reward.
    pub(super) fn ppo<S, const NX: usize, const NU: usize>(self, system: &S) -> Result<Trained>
    where
        S: System<NX, NU>,
    {
        let settings = &self.settings.ppo;
        let goal = self.config.goal(&system.states())?;
        let lesson = Lesson {
            reward: Reward { goal, weights: settings.reward.clone() },
            states: self.intervals(system)?,
            hidden: self.settings.hidden.clone(),
        };
        let mut learner = Ppo::new(self.task(system)?, lesson, settings.clone());
        let policy = &learner.exported()?;
        let program = self.backend.prepare(&Plant::recorded(system, policy))?;
        self.train(&mut learner, settings.iterations, &program)
    }

    /// What is trained on `system`, on what.
    fn task<'a, S, const NX: usize, const NU: usize>(
        &'a self,
        system: &'a S,
    ) -> Result<Task<'a, S, NX>>
    where
        S: System<NX, NU>,
    {
        let axes = system.states();
        Ok(Task {
            system,
            backend: self.backend,
            device: self.device.clone(),
            spec: self.config.settings(&axes)?.spec,
            tightening: None,
            mixture: self.config.mixture(&axes)?,
            held_out: self.settings.held_out,
            seed: self.config.seed,
        })
    }

    /// The box of the states, interval by interval.
    fn intervals<S, const NX: usize, const NU: usize>(&self, system: &S) -> Result<Vec<[f32; 2]>>
    where
        S: System<NX, NU>,
    {
        let checked = self.config.settings(&system.states())?;
        Ok((0..NX).map(|i| [checked.low[i], checked.high[i]]).collect())
    }
}
