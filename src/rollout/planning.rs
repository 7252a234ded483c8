//! Plans to improve: what they are made for, their problems, and what comes of them.

use std::sync::Arc;

use super::mppi::MppiSpec;
use super::sample::Stream;
use crate::cost::Cost;
use crate::error::{Error, Result};
use crate::model::{Model, StageCost};
use crate::policy::Mlp;
use crate::real::Real;
use crate::system::System;

/// What all plans of a controller are improved for, as data: a model, a cost, samples.
#[derive(Clone, Debug)]
pub struct Planning {
    /// The model; its task plays no part.
    pub model: Arc<Model>,
    /// What a stage costs.
    pub cost: Arc<StageCost>,
    /// Samples, horizon, temperature, noise.
    pub spec: Arc<MppiSpec>,
    /// Penalty on the value along the rollouts.
    pub value: Option<ValueTerm>,
    /// Disturbance of the rollouts.
    pub disturbance: Option<Disturbance>,
}

/// A penalty on the value of a network along a rollout: `weight max(0, threshold - Q(x_t))^2` at
/// each stage.
#[derive(Clone, Debug)]
pub struct ValueTerm {
    /// `Q`: one output for all states.
    pub network: Arc<Mlp>,
    /// Weight.
    pub weight: f32,
    /// Value below which it costs.
    pub threshold: f32,
}

/// A network that pushes the state at each step: `x_{t+1} = f(x_t, u_t) + sum_j scale_j d_j(x_t)`
/// on the coordinates named, as the disturbance of the study does on the opponent's velocities.
#[derive(Clone, Debug)]
pub struct Disturbance {
    /// `d`: as many outputs as there are entries.
    pub network: Arc<Mlp>,
    /// Coordinate and scale of each output.
    pub entries: Vec<(usize, f32)>,
}

/// One plan to improve.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiProblem {
    /// Where the plan starts, `[states]`.
    pub start: Vec<f32>,
    /// The nominal plan U, `[H, controls]`.
    pub plan: Vec<f32>,
    /// What the cost wants to know at each stage, `[H, contexts]`; where the end of a plan costs, a
    /// row for it behind them.
    pub context: Vec<f32>,
    /// Number of the step that the plan starts at: formulas of time count from it.
    pub first_step: u32,
    /// Stream of the noise: sample `k` has index `k` in it.
    pub stream: Stream,
}

impl MppiProblem {
    /// The problem of a plan whose controls and contexts are given stage by stage.
    ///
    /// ```
    /// use reachcast::rollout::{MppiProblem, Purpose, Stream};
    /// let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    /// let problem = MppiProblem::new([0.5, 0.0], &[[0.0]; 20], &[[0.0, 0.0, 0.0]; 20], stream);
    /// assert_eq!(problem.plan.len(), 20);
    /// ```
    pub fn new<U: AsRef<[f32]>, C: AsRef<[f32]>>(
        start: impl AsRef<[f32]>,
        plan: &[U],
        context: &[C],
        stream: Stream,
    ) -> Self {
        Self {
            start: start.as_ref().to_vec(),
            plan: plan.iter().flat_map(|u| u.as_ref()).copied().collect(),
            context: context.iter().flat_map(|row| row.as_ref()).copied().collect(),
            first_step: 0,
            stream,
        }
    }

    /// The same at the step number `first_step` of a closed loop.
    #[must_use]
    pub fn at_step(self, first_step: u32) -> Self {
        Self { first_step, ..self }
    }
}

/// Problems that are improved together.
#[derive(Clone, Copy, Debug)]
pub struct MppiTask<'a> {
    /// The problems.
    pub problems: &'a [MppiProblem],
    /// Number of the iteration: each has noise of its own.
    pub iteration: u32,
    /// Whether the cost of every sample is wanted.
    pub costs: CostQuery,
}

/// Whether the cost of every sample is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostQuery {
    /// Only what the plan needs.
    Summary,
    /// All of them: K numbers for each problem.
    Each,
}

/// An improved plan.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiResult {
    /// The weighted mean of the samples' controls, `[H, controls]`; the nominal plan, clipped, where
    /// no sample has a finite cost.
    pub plan: Vec<f32>,
    /// Smallest cost; infinite where none is finite.
    pub least_cost: f32,
    /// Mean of the finite costs.
    pub mean_cost: f64,
    /// `1 / sum w^2`, from 1 to K; 0 where no cost is finite.
    pub effective_samples: f64,
    /// The sample of the smallest cost, the first of equal ones.
    pub best: u32,
    /// Samples whose cost is not finite: their weight is 0.
    pub non_finite: u32,
    /// The cost of each sample, if asked for; infinite where it is not finite.
    pub costs: Vec<f32>,
}

impl MppiResult {
    /// The weight of each sample, `[K]`; empty unless the costs were asked for.
    pub fn weights(&self, temperature: f32) -> Vec<f64> {
        let excess = |cost: f32| f64::from(cost) - f64::from(self.least_cost);
        let raw = |cost: &f32| match cost.is_finite() {
            true => (-excess(*cost) / f64::from(temperature)).exp(),
            false => 0.0,
        };
        let raw: Vec<f64> = self.costs.iter().map(raw).collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
    }
}

impl Planning {
    /// Plans for a system and a cost that are written in Rust, without value term or disturbance.
    pub fn of<S, C, const NX: usize, const NU: usize, const NC: usize>(
        system: &S,
        cost: C,
        spec: MppiSpec,
    ) -> Self
    where
        S: System<NX, NU> + Clone + Send + Sync + 'static,
        C: Cost<NX, NU, NC> + Send + Sync + 'static,
    {
        Self {
            model: Arc::new(Model::of(system.clone())),
            cost: Arc::new(StageCost::of(system.clone(), cost)),
            spec: Arc::new(spec),
            value: None,
            disturbance: None,
        }
    }

    /// The same where stages are whole periods: plans look at samples alone.
    pub(crate) fn sampled(&self) -> Self {
        let model = match self.model.points {
            1 => Arc::clone(&self.model),
            _ => Arc::new(self.model.sampled().into_owned()),
        };
        Self { model, ..self.clone() }
    }

    /// The networks that take part: value and disturbance.
    pub(crate) fn networks(&self) -> [Option<&Arc<Mlp>>; 2] {
        let value = self.value.as_ref().map(|term| &term.network);
        [value, self.disturbance.as_ref().map(|asked| &asked.network)]
    }

    /// Refuses parts that do not fit each other.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a step that is none of the model, bounds that are not those of as many
    /// controls as the model has, a cost for another model, a network of the wrong shape, or a weight, threshold or scale that is not
    /// finite.
    pub(crate) fn check(&self) -> Result<()> {
        self.check_step()?;
        let (has, controls) = (self.spec.controls(), self.model.controls.len());
        if has != controls {
            let text = format!("has bounds of {has} controls; the model has {controls}");
            return Err(Error::invalid("plan", text));
        }
        self.cost.check(&self.model)?;
        self.check_value()?;
        self.check_disturbance()
    }

    fn check_step(&self) -> Result<()> {
        let Model { step, states, .. } = &*self.model;
        let [has, need] = [[step.inputs, step.outputs.len()], [self.model.inputs(), states.len()]];
        if !states.is_empty() && has == need {
            return Ok(());
        }
        let text = format!(
            "the formula takes {} inputs and gives {} numbers; {} and {} are needed, one state at \
             least",
            has[0], has[1], need[0], need[1]
        );
        Err(Error::invalid("model.step", text))
    }

    fn check_value(&self) -> Result<()> {
        let Some(term) = &self.value else { return Ok(()) };
        self.fits("value network", &term.network, 1)?;
        if term.weight.is_finite() && term.threshold.is_finite() {
            return Ok(());
        }
        let text = "weight and threshold of the value term have to be finite";
        Err(Error::invalid("value network", text))
    }

    fn check_disturbance(&self) -> Result<()> {
        let Some(Disturbance { network, entries }) = &self.disturbance else { return Ok(()) };
        self.fits("disturbance network", network, entries.len())?;
        let states = self.model.states.len();
        if entries.len() > states || entries.iter().any(|(state, _)| *state >= states) {
            let text = format!("its outputs go to states below {states}, at most one for each");
            return Err(Error::invalid("disturbance network", text));
        }
        if entries.iter().all(|(_, scale)| scale.is_finite()) {
            return Ok(());
        }
        let text = "the scale of each output has to be finite";
        Err(Error::invalid("disturbance network", text))
    }

    /// Refuses a network that does not map the states to `outputs` numbers by layers alone.
    fn fits(&self, name: &str, network: &Mlp, outputs: usize) -> Result<()> {
        if network.is_mapped() {
            let text = "has a map of its inputs or outputs, which samples of plans do not run; a network \
                        without one is needed";
            return Err(Error::invalid(name, text));
        }
        let (widths, states) = (network.widths(), self.model.states.len());
        let (inputs, has) = (widths[0], widths[widths.len() - 1]);
        if (inputs, has) == (states, outputs) {
            return Ok(());
        }
        let text =
            format!("maps {inputs} inputs to {has} outputs; {states} and {outputs} are needed");
        Err(Error::invalid(name, text))
    }

    /// Refuses problems that are none of these plans.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a start that is no state, a plan or context that has not H steps, or a
    /// number that is not finite.
    pub(crate) fn check_problems(&self, problems: &[MppiProblem]) -> Result<()> {
        let (horizon, states) = (self.spec.horizon(), self.model.states.len());
        let sizes =
            [(horizon, self.spec.controls()), (self.cost.rows(horizon), self.cost.contexts)];
        for (number, problem) in problems.iter().enumerate() {
            let lengths = [("plan", &problem.plan), ("context", &problem.context)];
            for ((name, numbers), (rows, size)) in lengths.into_iter().zip(sizes) {
                if numbers.len() != rows * size {
                    let has = numbers.len();
                    let text = format!(
                        "problem {number} has {has} numbers, expected {rows} steps of {size}"
                    );
                    return Err(Error::invalid(name, text));
                }
            }
            if problem.start.len() != states {
                let has = problem.start.len();
                let text = format!("problem {number} has {has} numbers, a state has {states}");
                return Err(Error::invalid("start", text));
            }
            let numbers = problem.start.iter().chain(&problem.plan).chain(&problem.context);
            if !numbers.copied().all(f32::is_finite) {
                let text = format!("problem {number} has a number that is not finite");
                return Err(Error::invalid("start, plan and context", text));
            }
        }
        Ok(())
    }

    /// The controls of a sample of `problem`, `[H, controls]`: the plan, its noise added, clipped.
    pub fn controls(&self, problem: &MppiProblem, iteration: u32, sample: u32) -> Vec<f32> {
        let noise = self.spec.noise().sample(problem.stream, iteration, sample);
        let bounds = self.spec.settings().bounds.iter().cycle();
        let clipped =
            |((u, e), [low, high]): ((&f32, f32), &[f32; 2])| Real::clamp(u + e, *low, *high);
        problem.plan.iter().zip(noise).zip(bounds).map(clipped).collect()
    }

    /// The states of a sample of `problem` without disturbance, `[H + 1]` of `[states]`.
    pub fn states(&self, problem: &MppiProblem, iteration: u32, sample: u32) -> Vec<Vec<f32>> {
        let mut states = vec![problem.start.clone()];
        let controls = self.controls(problem, iteration, sample);
        for (step, u) in controls.chunks(self.spec.controls()).enumerate() {
            states.push(self.model.next(&states[step], u, problem.first_step + step as u32));
        }
        states
    }
}
