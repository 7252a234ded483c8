//! Models recorded from systems that are written in Rust.

use std::array::from_fn;
use std::sync::Arc;

use super::compiled::CompiledForm;
use super::{Model, Picture, Task};
use crate::formula::{Expr, Graph, record_with};
use crate::system::System;
use crate::tile::{CompiledSystem, NativeSystem};

impl Model {
    /// The model of `system`: its formulas recorded, its declared parameters as inputs.
    ///
    /// ```
    /// use reachcast::model::Model;
    /// use reachcast::system::DoubleIntegrator;
    /// let model = Model::of(DoubleIntegrator::default());
    /// assert_eq!(model.states.len(), 2);
    /// // Position and velocity; the control; no more than it declares; time and step.
    /// assert_eq!(model.inputs(), 2 + 1 + model.parameters.len() + 2);
    /// ```
    pub fn of<S, const NX: usize, const NU: usize>(system: S) -> Self
    where
        S: System<NX, NU> + Send + Sync + 'static,
    {
        let model = Self::recorded(&system);
        let code: Arc<dyn NativeSystem> = Arc::new(CompiledSystem(system));
        let native = Some(CompiledForm::new(code, &model.formulas(), model.values()));
        Self { native, ..model }
    }

    /// The same of a system that is borrowed, without its compiled form.
    pub(super) fn recorded<S, const NX: usize, const NU: usize>(system: &S) -> Self
    where
        S: System<NX, NU>,
    {
        let record =
            |formula: &dyn Fn([Expr; NX], [Expr; NU]) -> Vec<Expr>| recorded(system, formula);
        Self {
            name: system.name().to_owned(),
            states: system.states().to_vec(),
            controls: system.controls().to_vec(),
            parameters: system.parameters(),
            period: None,
            points: 1,
            step: record(&|x, u| system.step(x, u).to_vec()),
            task: Task::default(),
            target: record(&|x, _| vec![system.target(x)]),
            constraint: record(&|x, _| vec![system.constraint(x)]),
            bodies: system.bodies(),
            picture: Picture::default(),
            smallest_feature: system.smallest_feature(),
            native: None,
        }
    }

    /// The compiled form, where formulas and parameters are still those of the system.
    pub(crate) fn compiled(&self) -> Option<&Arc<dyn NativeSystem>> {
        self.native.as_ref()?.of(&self.formulas(), &self.values())
    }

    /// What a compiled form computes.
    fn formulas(&self) -> [&Graph; 3] {
        [&self.step, &self.target, &self.constraint]
    }
}

/// Records `formula` of state and control with the inputs of the model of `system`.
pub(super) fn recorded<S, const NX: usize, const NU: usize>(
    system: &S,
    formula: impl FnOnce([Expr; NX], [Expr; NU]) -> Vec<Expr>,
) -> Graph
where
    S: System<NX, NU>,
{
    recorded_with(system, 0, |x, u, _| formula(from_fn(|i| x[i]), from_fn(|i| u[i])))
}

/// Records `formula` of states, controls and `more` inputs that stand behind those of the model of
/// `system`.
pub(super) fn recorded_with<S, const NX: usize, const NU: usize>(
    system: &S,
    more: usize,
    formula: impl FnOnce(&[Expr], &[Expr], &[Expr]) -> Vec<Expr>,
) -> Graph
where
    S: System<NX, NU>,
{
    let parameters = system.parameters();
    let names: Vec<(&str, usize)> = parameters
        .iter()
        .enumerate()
        .map(|(i, parameter)| (parameter.name.as_str(), NX + NU + i))
        .collect();
    let own = NX + NU + names.len() + 2;
    record_with(own + more, &names, |inputs| {
        formula(&inputs[..NX], &inputs[NX..NX + NU], &inputs[own..])
    })
}
