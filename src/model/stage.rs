//! What the stages of a plan and its end cost, as data.

use std::array::from_fn;
use std::fmt;
use std::sync::Arc;

use super::Model;
use super::compiled::CompiledForm;
use super::lookups::{Lookups, fits};
use super::recorded::recorded_with;
use super::terminal::TerminalCost;
use crate::cost::{Cost, CostMap, Lookup};
use crate::error::Result;
use crate::formula::{Expr, Graph};
use crate::system::System;
use crate::tile::{CompiledStages, NativeStages};

/// What a stage of a plan costs.
///
/// Its formulas take the inputs of the model, as [`Model::inputs`] counts them; the stage also the
/// contexts, behind them.
#[derive(Clone)]
pub struct StageCost {
    /// The cost of a stage, a single output; lower is better.
    pub stage: Graph,
    /// Numbers that the cost wants to know besides, one row for each stage of a problem, and one for its
    /// end where that costs.
    pub contexts: usize,
    /// The maps that the formula of a stage asks, an input for each behind the contexts.
    pub lookups: Option<Lookups>,
    /// What a map charges besides.
    pub map: Option<MapCost>,
    /// What the end of a plan costs.
    pub terminal: Option<TerminalCost>,
    /// System and cost as compiled, where they are written in Rust.
    native: Option<CompiledCost>,
}

/// A map, and where a state lies on it.
#[derive(Clone, Debug, PartialEq)]
pub struct MapCost {
    /// The map.
    pub map: Arc<CostMap>,
    /// The number of the cell, [`CostMap::cell`] of the place, of the inputs of the model.
    pub cell: Graph,
}

/// A cost as compiled, and the map that it charges by.
#[derive(Clone)]
struct CompiledCost {
    stages: Arc<CompiledForm<dyn NativeStages>>,
    map: Option<Arc<CostMap>>,
}

impl fmt::Debug for StageCost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { stage, contexts, map, terminal, native, .. } = self;
        let cells = map.as_ref().map(|map| map.map.cells().len());
        let terminal = terminal.as_ref().map(|terminal| terminal.formula.nodes.len());
        f.debug_struct("StageCost")
            .field("nodes", &stage.nodes.len())
            .field("contexts", contexts)
            .field("cells", &cells)
            .field("lookups", &self.lookups.as_ref().map(|lookups| lookups.maps.len()))
            .field("terminal", &terminal)
            .field("compiled", &native.is_some())
            .finish()
    }
}

impl StageCost {
    /// A cost as data, without anything compiled: what plans for a model that is given as text need.
    ///
    /// ```
    /// use std::path::Path;
    /// use std::sync::Arc;
    /// use reachcast::backend::Backend;
    /// use reachcast::formula::record;
    /// use reachcast::model::{StageCost, text};
    /// use reachcast::rollout::{
    ///     CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, Planning, Purpose, Stream,
    /// };
    ///
    /// let text = r#"
    /// [model]
    /// name = "cart"
    /// [model.states]
    /// position = { unit = "m", box = [-1.0, 1.0] }
    /// velocity = { unit = "m/s", box = [-1.0, 1.0] }
    /// [model.controls]
    /// force = { unit = "N", bounds = [-1.0, 1.0] }
    /// [model.flow]
    /// position = "velocity"
    /// velocity = "force"
    /// [model.time]
    /// period = 0.1
    /// integrator = "rk4"
    /// [model.task]
    /// kind = "reach-avoid"
    /// target = "0.1 - hypot(position, velocity)"
    /// constraint = "1.5 - abs(position)"
    /// "#;
    /// let model = Arc::new(text::read(text, "cart.toml", Path::new("."))?.model()?);
    ///
    /// // The square of the distance from a goal, which each stage is told behind the model's inputs.
    /// let goal = model.inputs();
    /// let stage = record(goal + 1, |x| {
    ///     let off = x[0] - x[goal];
    ///     vec![off * off]
    /// });
    /// let samples = MppiSettings::new(&model.controls, 256, 20);
    /// let planning = Planning {
    ///     model,
    ///     cost: Arc::new(StageCost::new(stage, 1, None)),
    ///     spec: Arc::new(MppiSpec::new(MppiSettings { temperature: 0.1, ..samples })?),
    ///     value: None,
    ///     disturbance: None,
    /// };
    /// let backend = Backend::cpu()?;
    /// let program = backend.prepare_plans(&planning)?;
    /// let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    /// let problem = MppiProblem::new([-0.5, 0.0], &[[0.0]; 20], &[[0.5]; 20], stream);
    /// let task = MppiTask { problems: &[problem], iteration: 0, costs: CostQuery::Summary };
    /// let improved = program.improve(&task)?;
    /// assert!(improved[0].plan[0] > 0.0, "it sets off to the right");
    /// # Ok::<(), reachcast::Error>(())
    /// ```
    pub fn new(stage: Graph, contexts: usize, map: Option<MapCost>) -> Self {
        Self { stage, contexts, lookups: None, map, terminal: None, native: None }
    }

    /// The same whose stage asks `lookups`, if there are any.
    #[must_use]
    pub fn with_lookups(self, lookups: Option<Lookups>) -> Self {
        Self { lookups, ..self }
    }

    /// The same with what the end of a plan costs, if it does.
    #[must_use]
    pub fn with_terminal(self, terminal: Option<TerminalCost>) -> Self {
        Self { terminal, ..self }
    }

    /// Rows of contexts of a plan of `horizon` stages.
    pub fn rows(&self, horizon: usize) -> usize {
        horizon + usize::from(self.terminal.is_some())
    }

    /// The maps that it charges by and asks, each once: that which charges a stage, those that a stage
    /// asks, those that the end asks.
    pub fn maps(&self) -> Vec<Arc<CostMap>> {
        let terminal = self.terminal.as_ref().and_then(|terminal| terminal.lookups.as_ref());
        let asked = self.lookups.iter().chain(terminal).flat_map(|lookups| &lookups.maps);
        let mut maps: Vec<Arc<CostMap>> = Vec::new();
        for map in self.map.iter().map(|map| &map.map).chain(asked) {
            if !maps.iter().any(|known| Arc::ptr_eq(known, map)) {
                maps.push(Arc::clone(map));
            }
        }
        maps
    }

    /// The formulas, those of cells included.
    pub(crate) fn graphs(&self) -> impl Iterator<Item = &Graph> {
        let terminal = self.terminal.iter().flat_map(|terminal| {
            let cells = terminal.lookups.iter().map(|lookups| &lookups.cells);
            cells.chain([&terminal.formula])
        });
        let cells = self.lookups.iter().map(|lookups| &lookups.cells);
        [&self.stage]
            .into_iter()
            .chain(self.map.iter().map(|map| &map.cell))
            .chain(cells)
            .chain(terminal)
    }

    /// The cost of a stage of `system`: recorded, and compiled together with its dynamics.
    ///
    /// ```
    /// use reachcast::cost::Quadratic;
    /// use reachcast::model::StageCost;
    /// use reachcast::system::DoubleIntegrator;
    /// let weights =
    ///     Quadratic { state: [1.0, 0.1], control: [0.01], last: [5.0, 1.0], obstacle: None };
    /// let cost = StageCost::of::<_, _, 2, 1, 3>(DoubleIntegrator::default(), weights);
    /// assert_eq!(cost.contexts, 3, "a reference for both states, and which stage is the last");
    /// ```
    pub fn of<S, C, const NX: usize, const NU: usize, const NC: usize>(system: S, cost: C) -> Self
    where
        S: System<NX, NU> + Send + Sync + 'static,
        C: Cost<NX, NU, NC> + Send + Sync + 'static,
    {
        let stage = |x: &[Expr], u: &[Expr], context: &[Expr]| {
            vec![cost.stage(from_fn(|i| x[i]), from_fn(|i| u[i]), from_fn(|i| context[i]))]
        };
        let stage = recorded_with(&system, NC, stage);
        let map = cost.map([0.0_f32; NX]).map(|lookup| MapCost {
            map: Arc::new(lookup.map.clone()),
            cell: recorded_with(&system, 0, |x, _, _| {
                let lookup = cost.map::<Expr>(from_fn(|i| x[i]));
                lookup.into_iter().map(|Lookup { map, place }| map.cell(place)).collect()
            }),
        });
        let terminal = cost.terminal([0.0_f32; NX], [0.0; NC]).map(|_| {
            TerminalCost::new(recorded_with(&system, NC, |x, _, context| {
                let terminal = cost.terminal::<Expr>(from_fn(|i| x[i]), from_fn(|i| context[i]));
                terminal.into_iter().collect()
            }))
        });
        let model = Model::recorded(&system);
        let code: Arc<dyn NativeStages> = Arc::new(CompiledStages { system, cost });
        let whole = Self::new(stage, NC, map).with_terminal(terminal);
        let formulas: Vec<&Graph> = [&model.step].into_iter().chain(whole.graphs()).collect();
        let stages = CompiledForm::new(code, &formulas, model.values());
        let map = whole.map.as_ref().map(|map| Arc::clone(&map.map));
        Self { native: Some(CompiledCost { stages, map }), ..whole }
    }

    /// The compiled form of the stages of `model`, where its dynamics, its parameters and this cost are
    /// still those that were compiled together.
    pub(crate) fn compiled(&self, model: &Model) -> Option<&Arc<dyn NativeStages>> {
        // A model that is asked to be run as text is.
        model.compiled()?;
        let CompiledCost { stages, map } = self.native.as_ref()?;
        let at = |map: Option<&Arc<CostMap>>| map.map(Arc::as_ptr);
        let formulas: Vec<&Graph> = [&model.step].into_iter().chain(self.graphs()).collect();
        let same = at(map.as_ref()) == at(self.map.as_ref().map(|map| &map.map));
        stages.of(&formulas, &model.values()).filter(|_| same)
    }

    /// The same without its compiled form, as if it were given as text: for benches of the two.
    #[doc(hidden)]
    #[must_use]
    pub fn as_text(self) -> Self {
        Self { native: None, ..self }
    }

    /// Refuses a cost whose formulas are not of the inputs of `model`.
    ///
    /// # Errors
    /// [`Error::Invalid`] with both numbers.
    pub(crate) fn check(&self, model: &Model) -> Result<()> {
        let own = model.inputs() + self.contexts;
        let asked =
            |lookups: &Option<Lookups>| lookups.as_ref().map_or(0, |asked| asked.maps.len());
        fits("stage", &self.stage, [own + asked(&self.lookups), 1])?;
        if let Some(map) = &self.map {
            fits("map", &map.cell, [model.inputs(), 1])?;
        }
        if let Some(terminal) = &self.terminal {
            fits("terminal cost", &terminal.formula, [own + asked(&terminal.lookups), 1])?;
            terminal.check(model)?;
        }
        let terminal = self.terminal.as_ref().and_then(|terminal| terminal.lookups.as_ref());
        self.lookups.iter().chain(terminal).try_for_each(|lookups| lookups.check(own))
    }
}
