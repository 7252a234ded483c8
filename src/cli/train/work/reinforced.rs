//! Training by reinforcement.

use std::sync::Arc;

use super::Training;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::train::analytic::Task;
use crate::train::ddpg::{Ddpg, Game};
use crate::train::ppo::{Lesson, Ppo};
use crate::train::reward::Reward;
use crate::train::run::Trained;

impl Training<'_> {
    /// Control, disturbance and critic of `model`.
    pub(super) fn ddpg(self, model: &Arc<Model>) -> Result<Trained> {
        let game = Game {
            contest: self.config.contest(model)?,
            states: self.intervals(model)?,
            hidden: self.settings.hidden.clone(),
        };
        let settings = &self.settings.ddpg;
        let mut learner = Ddpg::new(self.task(model)?, game, settings.clone())?;
        let [policy, ..] = learner.exported()?;
        let program = self.backend.prepare(&self.config.interface(model)?.plant(model, policy))?;
        self.train(&mut learner, settings.iterations, &program)
    }

    /// A policy of `model` on its ordinary reward.
    pub(super) fn ppo(self, model: &Arc<Model>) -> Result<Trained> {
        let settings = &self.settings.ppo;
        let goal = self.goal(model)?;
        let lesson = Lesson {
            reward: Reward { task: model.task, goal, weights: settings.reward.clone() },
            states: self.intervals(model)?,
            hidden: self.settings.hidden.clone(),
        };
        let mut learner = Ppo::new(self.task(model)?, lesson, settings.clone());
        let plant = self.config.interface(model)?.plant(model, learner.exported()?);
        let program = self.backend.prepare(&plant)?;
        self.train(&mut learner, settings.iterations, &program)
    }

    /// The goal of the ordinary reward; a system that the program carries has one.
    fn goal(&self, model: &Model) -> Result<Vec<(usize, f32)>> {
        let goal = self.config.goal(&model.states)?;
        match goal.is_empty() && self.config.model.is_none() {
            true => Err(Error::invalid("train.ppo.reward.goal", "empty; name a state")),
            false => Ok(goal),
        }
    }

    /// What is trained on `model`, on what.
    pub(super) fn task(&self, model: &Arc<Model>) -> Result<Task<'_>> {
        Ok(Task {
            model: Arc::clone(model),
            interface: self.config.interface(model)?,
            backend: self.backend,
            device: self.device.clone(),
            spec: self.config.settings(&model.states)?.spec,
            tightening: None,
            mixture: self.config.mixture(&model.states)?,
            held_out: self.settings.held_out,
            seed: self.config.seed,
        })
    }

    /// The box of the states, interval by interval.
    pub(super) fn intervals(&self, model: &Model) -> Result<Vec<[f32; 2]>> {
        let checked = self.config.settings(&model.states)?;
        Ok(checked.low.into_iter().zip(checked.high).map(|(low, high)| [low, high]).collect())
    }
}
