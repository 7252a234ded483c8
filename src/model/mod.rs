//! The model: a plant and its task as plain data, recorded from Rust or read from text.

mod compiled;
mod controller;
mod costs;
mod fit;
mod identity;
mod interface;
mod lookups;
mod picture;
mod plant;
mod points;
mod recorded;
mod reference;
mod role;
mod stage;
mod task;
mod task_words;
mod terminal;
pub mod text;

use std::sync::Arc;

pub use controller::{Controller, Law};
pub use costs::{Costs, Term, TermKind};
pub use interface::Interface;
pub use lookups::Lookups;
pub use picture::{Outline, Picture, PlacedBody, Shape, ShapeKind};
pub use plant::Plant;
pub use points::Moment;
#[cfg(feature = "gpu")]
pub(crate) use points::share;
pub use reference::{Reference, ReferenceSource};
pub use role::Role;
pub use stage::{MapCost, StageCost};
pub use task::{Task, Window};
pub use task_words::Form;
pub use terminal::TerminalCost;

use self::compiled::CompiledForm;
use crate::formula::Graph;
pub use crate::system::Parameter;
use crate::system::{Axis, Body, Feature};
use crate::tile::NativeSystem;

/// A plant and its task: what a batch of rollouts is about.
///
/// Every formula takes the inputs that [`Model::inputs`] counts, in this order: the states, the
/// controls, the parameters, the time in seconds, the number of the step.
#[derive(Clone, Debug)]
pub struct Model {
    /// Short name, lower case with hyphens.
    pub name: String,
    /// Name, unit and default box of each state; the order is the state order of every file.
    pub states: Vec<Axis>,
    /// Name, unit and bounds of each control.
    pub controls: Vec<Axis>,
    /// The numbers that are fixed for a rollout.
    pub parameters: Vec<Parameter>,
    /// Seconds between two steps; none where the model does not say.
    pub period: Option<f32>,
    /// Parts of a period, at the end of each of which the state is looked at; 1: at samples alone.
    pub points: u32,
    /// The state after one part, `[states]`: the next one where there is 1; clips the controls to their bounds.
    pub step: Graph,
    /// What a rollout has to do.
    pub task: Task,
    /// Target margin: positive inside the target set.
    pub target: Graph,
    /// Constraint margin: positive where safe.
    pub constraint: Graph,
    /// The bodies that a picture shows.
    pub bodies: Vec<Body>,
    /// What else a picture shows.
    pub picture: Picture,
    /// The narrowest thing that the margins know of, where it is known.
    pub smallest_feature: Option<Feature>,
    /// The system as compiled, where it is written in Rust.
    pub(crate) native: Option<Arc<CompiledForm<dyn NativeSystem>>>,
}

/// Models are equal where all that is computed and drawn is; whether somebody compiled them, or said
/// how wide things are, makes no difference.
impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        let same_axes = self.states == other.states && self.controls == other.controls;
        let same_data = self.parameters == other.parameters && self.period == other.period;
        let same_formulas = self.step == other.step
            && self.points == other.points
            && self.task == other.task
            && self.target == other.target
            && self.constraint == other.constraint;
        self.name == other.name
            && same_axes
            && same_data
            && same_formulas
            && self.bodies == other.bodies
            && self.picture == other.picture
    }
}

impl Model {
    /// Inputs of each formula: states, controls, parameters, time and step.
    pub fn inputs(&self) -> usize {
        self.states.len() + self.controls.len() + self.parameters.len() + 2
    }

    /// The same without its compiled form, as if it were given as text: for benches of the two.
    #[doc(hidden)]
    #[must_use]
    pub fn as_text(self) -> Self {
        Self { native: None, ..self }
    }

    /// The values of the parameters.
    pub fn values(&self) -> Vec<f32> {
        self.parameters.iter().map(|parameter| parameter.value).collect()
    }
}
