//! What value networks learn from: states, or states with a control, and the measures there.

use super::purpose;
use super::rows::{WIDTH, columns};
use super::starts::Mixture;
use crate::backend::Program;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::real::Lanes;
use crate::rollout::{NON_FINITE, Purpose, RolloutSpec, StateList, States, Stream};
use crate::system::Axis;

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
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The plant whose rollouts are measured, prepared on who runs them.
    pub program: &'a Program<'a>,
    /// Length and discount.
    pub spec: RolloutSpec,
    /// Where starts are drawn from.
    pub mixture: &'a Mixture,
    /// Share of the states that the policy meets on its way, in place of starts.
    pub visited: f64,
    /// Seed of every stream.
    pub seed: u64,
}

impl Source<'_> {
    /// `count` states with `V(x)`, the measure of the policy's rollout.
    ///
    /// # Errors
    /// Those of the device.
    pub fn values(&self, purpose: Purpose, count: usize) -> Result<Samples> {
        let states = self.states(purpose, count);
        let measures = self.program.measures(&states, &self.spec)?;
        Ok(Samples::new(states.view().size(), states.view().numbers().to_vec(), measures))
    }

    /// `count` states and random controls with `Q(x, u)`, the measure of the rollout from x whose first control
    /// is u and whose others are the policy's; `chosen` is [`chosen_first`](super::chosen::chosen_first) of the
    /// plant, prepared.
    ///
    /// # Errors
    /// [`Error::Invalid`] for controls without bounds, and those of the device.
    pub fn action_values(
        &self,
        chosen: &Program<'_>,
        purpose: Purpose,
        count: usize,
    ) -> Result<Samples> {
        let model = &self.program.plant().model;
        check_bounded(model)?;
        let (states, controls) = (self.states(purpose, count), self.controls(purpose, count));
        let acts = controls.chunks_exact(model.controls.len());
        let rows = states.view().iter().zip(acts).flat_map(|(x, u)| x.iter().chain(u).copied());
        let (rows, columns): (Vec<f32>, _) = (rows.collect(), chosen.plant().model.states.len());
        let measures = chosen.measures(States::of(&rows, columns), &self.spec)?;
        Ok(Samples::new(columns, rows, measures))
    }

    /// Controls anywhere between their bounds, `[count, controls]`.
    fn controls(&self, purpose: Purpose, count: usize) -> Vec<f32> {
        let axes = &self.program.plant().model.controls;
        let (low, high): (Vec<f32>, Vec<f32>) =
            axes.iter().map(|axis| (axis.low, axis.high)).unzip();
        let stream = Stream::new(self.seed, purpose::CONTROL, purpose.number());
        let drawn = |i: u64| stream.in_box::<1>(&low, &high, i).into_iter().map(|lane| lane.0[0]);
        (0..count as u64).flat_map(drawn).collect()
    }

    /// Starts, and states that the policy meets: of each group of starts those at one step.
    fn states(&self, purpose: Purpose, count: usize) -> StateList {
        let plant = self.program.plant();
        let mut states = self.mixture.draw(self.seed, purpose, 0, count);
        let met = (self.visited * count as f64).round() as usize;
        let starts = self.mixture.draw(self.seed, purpose, 1, count);
        let stride = count as f64 / met.max(1) as f64;
        for group in 0..met.div_ceil(WIDTH) {
            // Spread over the parts of the mixture, which stand one after the other.
            let place = |i: usize| ((group * WIDTH + i) as f64 * stride) as usize;
            let rows = (0..WIDTH).flat_map(|i| starts.row(place(i).min(count - 1)));
            let rows: Vec<f32> = rows.copied().collect();
            let mut x = columns(&rows, starts.view().size(), 0);
            for step in 0..group as u32 % (self.spec.horizon + 1) {
                x = plant.model.next(&x, &plant.control(&x, step), step);
            }
            for i in 0..WIDTH.min(met - group * WIDTH) {
                let state: Vec<f32> = x.iter().map(|lane: &Lanes<WIDTH>| lane.0[i]).collect();
                states.set(place(i), &state);
            }
        }
        states
    }
}

/// Refuses controls that have an open bound: none can be drawn between their bounds.
fn check_bounded(model: &Model) -> Result<()> {
    let open = |axis: &&Axis| !(axis.low.is_finite() && axis.high.is_finite());
    let Some(axis) = model.controls.iter().find(open) else { return Ok(()) };
    let problem = "open: `action-value` draws controls between their bounds; give finite ones";
    Err(Error::invalid(format!("model.controls.{}.bounds", axis.name), problem))
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
