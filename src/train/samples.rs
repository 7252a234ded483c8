//! What value networks learn from: states, or states with a control, and the measures there.

use super::purpose;
use super::starts::Mixture;
use crate::backend::Backend;
use crate::error::Result;
use crate::policy::Policy;
use crate::real::Lanes;
use crate::rollout::{
    NON_FINITE, Plant, Purpose, Query, ReachAvoidTask, RolloutSpec, Starts, Stream, Tightening,
};
use crate::system::System;

/// Rollouts side by side.
const WIDTH: usize = 16;

/// Inputs `[count, columns]`, row by row, and the measure of each row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Numbers per row.
    pub columns: usize,
    /// The inputs.
    pub inputs: Vec<f32>,
    /// Their measures, all finite.
    pub measures: Vec<f32>,
}

/// Where samples come from.
#[derive(Clone, Debug)]
pub struct Source<'a, S, P, const NX: usize> {
    /// System and policy whose rollouts are measured.
    pub plant: Plant<'a, S, P>,
    /// Who runs them.
    pub backend: &'a Backend,
    /// Length and discount.
    pub spec: RolloutSpec,
    /// Where starts are drawn from.
    pub mixture: Mixture<NX>,
    /// Share of the states that the policy meets on its way, in place of starts.
    pub visited: f64,
    /// Seed of every stream.
    pub seed: u64,
}

impl<S, P, const NX: usize> Source<'_, S, P, NX> {
    /// `count` states with `V(x)`, the measure of the policy's rollout.
    ///
    /// # Errors
    /// Those of the device.
    pub fn values<const NU: usize>(&self, purpose: Purpose, count: usize) -> Result<Samples>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let states = self.states::<NU>(purpose, count);
        let measures = self.measures::<NU>(&states, self.spec)?;
        Ok(Samples::new(NX, states.as_flattened().to_vec(), measures))
    }

    /// `count` states and random controls with `Q(x, u)`, the measure after one step under u and
    /// the others under the policy: `min(c, max(r, gamma V(f(x, u))))`, V over one step less.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a horizon of one step, and those of the device.
    pub fn action_values<const NU: usize>(&self, purpose: Purpose, count: usize) -> Result<Samples>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let system = self.plant.system;
        let (low, high): (Vec<f32>, Vec<f32>) =
            system.controls().iter().map(|axis| (axis.low, axis.high)).unzip();
        let stream = Stream::new(self.seed, purpose::CONTROL, purpose.number());
        let states = self.states::<NU>(purpose, count);
        let control = |i: usize| -> [f32; NU] {
            let drawn = stream.in_box::<1>(&low, &high, i as u64);
            std::array::from_fn(|j| drawn[j].0[0])
        };
        let controls: Vec<[f32; NU]> = (0..count).map(control).collect();
        let pairs = || states.iter().zip(&controls);
        let next: Vec<[f32; NX]> = pairs().map(|(x, u)| system.step(*x, *u)).collect();
        let spec = RolloutSpec::new(self.spec.horizon - 1, self.spec.gamma)?;
        let mut measures = self.measures::<NU>(&next, spec)?;
        for (measure, x) in measures.iter_mut().zip(&states) {
            let reached = system.target(*x).max(spec.gamma * *measure);
            // A state that is not finite stays marked as such.
            if *measure > NON_FINITE {
                *measure = system.constraint(*x).min(reached);
            }
        }
        let inputs = pairs().flat_map(|(x, u)| x.iter().chain(u).copied()).collect();
        Ok(Samples::new(NX + NU, inputs, measures))
    }

    /// Starts, and states that the policy meets: of each group of starts those at one step.
    fn states<const NU: usize>(&self, purpose: Purpose, count: usize) -> Vec<[f32; NX]>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let mut states = self.mixture.draw(self.seed, purpose, 0, count);
        let met = (self.visited * count as f64).round() as usize;
        let starts = self.mixture.draw(self.seed, purpose, 1, count);
        let stride = count as f64 / met.max(1) as f64;
        for group in 0..met.div_ceil(WIDTH) {
            // Spread over the parts of the mixture, which stand one after the other.
            let place = |i: usize| ((group * WIDTH + i) as f64 * stride) as usize;
            let list: Vec<[f32; NX]> =
                (0..WIDTH).map(|i| starts[place(i).min(count - 1)]).collect();
            let mut x = [Lanes([0.0; WIDTH]); NX];
            Starts::listed(&list).load(0, &mut x);
            for _ in 0..group as u32 % (self.spec.horizon + 1) {
                x = self.plant.system.step(x, self.plant.policy.control(x));
            }
            for i in 0..WIDTH.min(met - group * WIDTH) {
                states[place(i)] = x.map(|lane: Lanes<WIDTH>| lane.0[i]);
            }
        }
        states
    }

    /// The measure of each state.
    fn measures<const NU: usize>(&self, states: &[[f32; NX]], spec: RolloutSpec) -> Result<Vec<f32>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let task = ReachAvoidTask {
            starts: Starts::listed(states),
            range: 0..states.len() as u64,
            spec,
            tightening: &Tightening::none(&spec),
            query: Query::Measure,
        };
        let mut measures = Vec::with_capacity(states.len());
        self.backend.reach_avoid(self.plant, &task, &mut |_, values| {
            measures.extend_from_slice(values);
            Ok(())
        })?;
        Ok(measures)
    }
}

impl Samples {
    /// The rows whose measures are finite.
    fn new(columns: usize, inputs: Vec<f32>, measures: Vec<f32>) -> Self {
        let mut samples = Self { columns, ..Self::default() };
        for (row, measure) in inputs.chunks_exact(columns).zip(measures) {
            if measure > NON_FINITE {
                samples.inputs.extend_from_slice(row);
                samples.measures.push(measure);
            }
        }
        samples
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.measures.len()
    }

    /// Whether no row is left.
    pub fn is_empty(&self) -> bool {
        self.measures.is_empty()
    }

    /// Row number `i`.
    pub fn row(&self, i: usize) -> &[f32] {
        &self.inputs[i * self.columns..(i + 1) * self.columns]
    }
}
