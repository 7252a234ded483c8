//! Min-max DDPG: a critic of the task's backup, a control that ascends it, and a disturbance
//! that descends it.

use std::sync::Arc;

use burn_tensor::Tensor;

use super::agent::Agent;
use super::analytic::{LAST, Task};
use super::backup::Margins;
use super::contest::Contest;
use super::device::{floats, number};
use super::environments::Environments;
use super::network::{Architecture, Network};
use super::purpose;
use super::replay::Replay;
use super::rows::Rows;
use super::run::Learner;
use super::score::{share, successes};
use super::settings::DdpgSettings;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::policy::{Activation, Mlp};
use crate::rollout::{RolloutSpec, StateList, States, Stream};

/// The backup knows no horizon: what the critic tells is compared with rollouts so many times as
/// long as those that are scored.
const LONGER: u32 = 4;

/// What the disturbance does, and what the networks see.
#[derive(Clone, Debug)]
pub struct Game {
    /// What each output of the disturbance does.
    pub contest: Contest,
    /// Interval of each state.
    pub states: Vec<[f32; 2]>,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
}

/// Control, disturbance and critic under training.
#[derive(Debug)]
pub struct Ddpg<'a> {
    task: Task<'a>,
    contest: Contest,
    settings: DdpgSettings,
    environments: Environments,
    /// Rows of state, control and disturbance: all else follows from them.
    replay: Replay,
    control: Agent,
    disturbance: Agent,
    critic: Agent,
    held_out: StateList,
}

impl<'a> Ddpg<'a> {
    /// Random networks, and plants at their starts.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a model whose formulas read the time: the backup knows none.
    pub fn new(task: Task<'a>, game: Game, settings: DdpgSettings) -> Result<Self> {
        check_stationary(&task.model)?;
        task.check_interface()?;
        let Game { contest, states, hidden } = game;
        let (outputs, pushes) = (task.interface.outputs, contest.names.len());
        let random = |number: u32, inputs: Vec<[f32; 2]>, outputs, output, last| {
            let (hidden, activation) = (hidden.clone(), Activation::Relu);
            let shape = Architecture { inputs, hidden, outputs, activation, output };
            let stream = Stream::new(task.seed, purpose::WEIGHT, number);
            Agent::new(Network::random(shape, stream, last))
        };
        let actor =
            |number, inputs, outputs| random(number, inputs, outputs, Activation::Tanh, LAST);
        let seen = task.interface.intervals(&states);
        let acts = vec![[-1.0, 1.0]; outputs + pushes];
        let joint = [states.clone(), acts].concat();
        let horizon = task.spec.horizon;
        Ok(Self {
            control: actor(0, seen, outputs),
            disturbance: actor(1, states, pushes),
            replay: Replay::new(settings.replay, joint.len()),
            critic: random(2, joint, 1, Activation::Identity, 1.0),
            environments: Environments::new(
                task.mixture.clone(),
                task.seed,
                horizon,
                settings.environments,
            ),
            held_out: task.mixture.draw(task.seed, purpose::HELD_OUT, 0, task.held_out as usize),
            contest,
            settings,
            task,
        })
    }

    /// Acts of both players at a state: outputs of the policy, then disturbances.
    fn acts(&self) -> usize {
        self.task.interface.outputs + self.contest.names.len()
    }

    /// The states after `states` under the acts of each.
    fn next(&self, states: States<'_>, acts: &[f32]) -> Vec<f32> {
        let outputs = self.task.interface.outputs;
        let acts = || acts.chunks_exact(self.acts());
        let out: Vec<f32> = acts().flat_map(|acts| &acts[..outputs]).copied().collect();
        let d: Vec<f32> = acts().flat_map(|acts| &acts[outputs..]).copied().collect();
        let rows = Rows::new(&self.task.model, states.numbers());
        rows.disturbed(&self.contest.step, &rows.controls(&self.task.interface, &out), &d)
    }

    /// The margins of each state, as far as the task knows them.
    fn margins(&self, rows: &Rows<'_>) -> Vec<Margins<f32>> {
        let task = &self.task.model.task;
        rows.margins().into_iter().map(|margins| margins.counted(task)).collect()
    }

    /// One step of every plant, remembered.
    fn explore(&mut self, iteration: u64) {
        let count = self.environments.len();
        let first = iteration * count as u64;
        let numbers = self.environments.states.clone();
        let states = States::of(&numbers, self.task.model.states.len());
        let acts = self.tried(first, states);
        for (i, (x, acts)) in states.iter().zip(acts.chunks_exact(self.acts())).enumerate() {
            self.replay.write(first + i as u64, &[x, acts].concat());
        }
        let next = self.next(states, &acts);
        let rows = Rows::new(&self.task.model, &next);
        let margins = self.margins(&rows);
        // Where an episode ends says what is seen, not what it is worth: no state is terminal.
        self.environments.advance(iteration, rows.states, |i| margins[i].constraint <= 0.0);
    }

    /// What both players try at `states`, whose first is sample number `first`: their own acts
    /// with noise, or for a share of the plants any act; row by row.
    fn tried(&self, first: u64, states: States<'_>) -> Vec<f32> {
        let size = self.acts();
        let device = &self.task.device;
        let [seen, rows] = self.task.seen(states);
        let u = self.control.network.fixed(device).forward(seen);
        let d = self.disturbance.network.fixed(device).forward(rows);
        let own = floats(Tensor::cat(vec![u, d], 1).inner());
        let noise = Stream::new(self.task.seed, purpose::NOISE, 0);
        let uniform = Stream::new(self.task.seed, purpose::CONTROL, 0);
        let act = |(i, own): (usize, &[f32])| {
            let (index, random) = (first + i as u64, self.settings.random);
            // Spread over the parts of the mixture, which stand one after the other.
            if ((i + 1) as f64 * random).floor() > (i as f64 * random).floor() {
                let drawn = uniform.in_box::<1>(&vec![-1.0; size], &vec![1.0; size], index);
                return drawn.into_iter().map(|lane| lane.0[0]).collect::<Vec<_>>();
            }
            let noise = noise.normals(index, size);
            let noisy =
                |(act, z): (&f32, f32)| (act + self.settings.noise as f32 * z).clamp(-1.0, 1.0);
            own.iter().zip(noise).map(noisy).collect()
        };
        own.chunks_exact(size).enumerate().flat_map(act).collect()
    }

    /// Rows that were remembered, each of a state and the acts there.
    fn remembered(&self, iteration: u64) -> Vec<f32> {
        let batch = self.settings.batch;
        let written = (iteration + 1) * self.environments.len() as u64;
        let choice = Stream::new(self.task.seed, purpose::CHOICE, 0);
        self.replay
            .draw(written, choice, iteration * batch as u64, batch)
            .flatten()
            .copied()
            .collect()
    }

    /// What the critic should tell for `rows`: the backup of what the slow copies tell of the next
    /// states, held where the margins there say that it lies.
    fn wanted(&self, rows: &[f32]) -> Vec<f32> {
        let (model, gamma) = (&self.task.model, self.task.spec.gamma);
        let size = model.states.len();
        let rows = || rows.chunks_exact(size + self.acts());
        let states: Vec<f32> = rows().flat_map(|row| &row[..size]).copied().collect();
        let acts: Vec<f32> = rows().flat_map(|row| &row[size..]).copied().collect();
        let now = Rows::new(model, &states);
        let next = self.next(now.states, &acts);
        let next = Rows::new(model, &next);
        let slow = [&self.control.slow, &self.disturbance.slow, &self.critic.slow];
        let mut wanted = self.told(slow, next.states);
        for ((value, next), now) in
            wanted.iter_mut().zip(self.margins(&next)).zip(self.margins(&now))
        {
            *value = now.backup(gamma, next.hold(*value));
        }
        wanted
    }

    /// What `critic` tells of `states` under the acts of both players.
    fn told(&self, [control, disturbance, critic]: [&Network; 3], states: States<'_>) -> Vec<f32> {
        let device = &self.task.device;
        let [seen, x] = self.task.seen(states);
        let u = control.fixed(device).forward(seen);
        let acts = [u, disturbance.fixed(device).forward(x.clone())];
        floats(critic.fixed(device).forward(joint(&x, acts)).inner())
    }

    /// One update of the critic on `rows`; returns its loss, `mean(td^2 |td|)`.
    fn criticise(&mut self, rows: &[f32], progress: [u64; 2]) -> f64 {
        let wanted = self.wanted(rows);
        let (count, columns) = (wanted.len(), rows.len() / wanted.len());
        let device = &self.task.device;
        let critic = self.critic.network.bind(device);
        let told = critic.forward(device.tensor(rows.to_vec(), [count, columns]));
        let apart = (told - device.tensor(wanted, [count, 1])).abs();
        let loss = (apart.clone() * apart.clone() * apart).mean();
        let gradient = critic.gradient(&loss.backward());
        let DdpgSettings { critic, polyak, .. } = &self.settings;
        self.critic.follow(&gradient, critic, progress, *polyak);
        number(loss)
    }

    /// One update of both players at the states of `rows`, from one reverse sweep.
    fn play(&mut self, rows: &[f32], progress: [u64; 2]) {
        let size = self.task.model.states.len();
        let columns = size + self.acts();
        let states: Vec<f32> =
            rows.chunks_exact(columns).flat_map(|row| &row[..size]).copied().collect();
        let device = &self.task.device;
        let [seen, x] = self.task.seen(States::of(&states, size));
        let [control, disturbance] =
            [&self.control, &self.disturbance].map(|actor| actor.network.bind(device));
        let acts = [control.forward(seen), disturbance.forward(x.clone())];
        let worth = self.critic.network.fixed(device).forward(joint(&x, acts)).mean();
        let slopes = worth.backward();
        let rises: Vec<f32> = control.gradient(&slopes).into_iter().map(|slope| -slope).collect();
        let falls = disturbance.gradient(&slopes);
        let DdpgSettings { actor, polyak, .. } = &self.settings;
        self.control.follow(&rises, actor, progress, *polyak);
        self.disturbance.follow(&falls, actor, progress, *polyak);
    }

    /// Control, disturbance and critic as the engine takes them.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a parameter is not finite.
    pub fn exported(&self) -> Result<[Mlp; 3]> {
        let Task { model, interface, .. } = &self.task;
        let states: Vec<String> = model.states.iter().map(|axis| axis.name.clone()).collect();
        let outputs: Vec<String> = match &interface.act {
            None => model.controls.iter().map(|axis| axis.name.clone()).collect(),
            Some(_) => (0..interface.outputs).map(|number| format!("out[{number}]")).collect(),
        };
        let joint = [states.clone(), outputs, self.contest.names.clone()].concat();
        Ok([
            self.control.network.export(self.task.order())?,
            self.disturbance.network.export(states)?,
            self.critic.network.export(joint)?,
        ])
    }
}

/// Refuses a model whose formulas read the time, for what is learned of states alone, whenever they are
/// met.
///
/// # Errors
/// [`Error::Invalid`] saying so.
fn check_stationary(model: &Model) -> Result<()> {
    if model.is_stationary() {
        return Ok(());
    }
    let problem = "its formulas read the time; train with `analytic`, `ppo`, `value` or `action-value`, which \
                   know at which step a state is met, or make the time a state";
    Err(Error::invalid("model", problem))
}

/// States and acts side by side.
fn joint(x: &Tensor<2>, [u, d]: [Tensor<2>; 2]) -> Tensor<2> {
    Tensor::cat(vec![x.clone(), u, d], 1)
}

impl Learner for Ddpg<'_> {
    fn update(&mut self, iteration: u64) -> Result<f64> {
        self.explore(iteration);
        let rows = self.remembered(iteration);
        let progress = [iteration, self.settings.iterations];
        let loss = self.criticise(&rows, progress);
        self.play(&rows, progress);
        Ok(loss)
    }

    fn score_names(&self) -> Vec<String> {
        vec![
            "share of held-out starts with G > 0".to_owned(),
            "the same under the disturbance".to_owned(),
            "share of signs of longer disturbed rollouts that the critic tells".to_owned(),
        ]
    }

    fn scores(&self) -> Result<Vec<f64>> {
        let Task { model, interface, backend, spec, .. } = &self.task;
        let [policy, disturbance, _] = self.exported()?.map(Arc::new);
        let starts = self.held_out.view();
        let calm = self.task.succeeds(Arc::clone(&policy), starts)?;
        let model = Arc::new(self.contest.disturbed(model, &disturbance));
        let plant = interface.plant(&model, policy);
        let pushed = successes(backend, &plant, *spec, starts)?;
        let longer = RolloutSpec::new(LONGER * spec.horizon, spec.gamma)?;
        let ever = successes(backend, &plant, longer, starts)?;
        let networks = [&self.control, &self.disturbance, &self.critic].map(|agent| &agent.network);
        let told = self.told(networks, starts);
        let right = told.iter().zip(ever).map(|(told, success)| (*told > 0.0) == success);
        Ok(vec![share(calm.into_iter()), share(pushed.into_iter()), share(right)])
    }

    fn networks(&self) -> Result<Vec<(&'static str, Mlp)>> {
        let [policy, disturbance, critic] = self.exported()?;
        Ok(vec![("critic", critic), ("disturbance", disturbance), ("policy", policy)])
    }

    fn arrays(&mut self) -> Vec<(&'static str, &mut Vec<f32>)> {
        let Self { environments, replay, control, disturbance, critic, .. } = self;
        let networks = [
            (control, ["control", "control.slow", "control.first", "control.second"]),
            (
                disturbance,
                ["disturbance", "disturbance.slow", "disturbance.first", "disturbance.second"],
            ),
            (critic, ["critic", "critic.slow", "critic.first", "critic.second"]),
        ];
        let networks = networks.into_iter().flat_map(|(agent, names)| agent.arrays(names));
        let plants = [
            ("states", &mut environments.states),
            ("ages", &mut environments.ages),
            ("replay", &mut replay.rows),
        ];
        networks.chain(plants).collect()
    }
}
