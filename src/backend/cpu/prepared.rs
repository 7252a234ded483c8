//! A plant as the CPU runs it: formulas compiled or as tapes, its network packed.

use std::sync::Arc;

use super::Cpu;
use super::chained::Pack;
use super::interpreted::{Held, Inputs, InterpretedFormula, InterpretedSystem};
use super::mlp::Packed;
use super::tile::{Around, TileLaw, TilePlant};
use crate::backend::{MeasureSink, PairSink};
use crate::error::Result;
use crate::formula::Graph;
use crate::model::{Law, Model, Plant, Task};
use crate::policy::Mlp;
use crate::rollout::{DeviationTask, Farthest, ReachAvoidTask};
use crate::tile::{Clock, Layout, NativeFormula, NativeSystem};

/// A plant prepared for tiles.
#[derive(Debug)]
pub(in crate::backend) struct Prepared {
    system: Arc<dyn NativeSystem>,
    task: Task,
    points: u32,
    law: PreparedLaw,
    layout: Layout,
    clock: Clock,
}

/// Where the controls come from.
#[derive(Debug)]
enum PreparedLaw {
    Formula(Arc<dyn NativeFormula>),
    Network { network: Arc<Packed>, observe: Option<Beside>, act: Option<Beside> },
}

/// A formula before or behind a network, and the rows between the two.
#[derive(Debug)]
struct Beside {
    formula: InterpretedFormula,
    rows: [usize; 2],
}

/// What the formulas of a plant need of a frame, as they are prepared one by one.
struct Needs<'a> {
    model: &'a Model,
    values: Vec<f32>,
    layout: Layout,
    clock: Clock,
    /// Packs networks that formulas call.
    pack: Pack<'a>,
}

impl Cpu {
    /// See [`crate::backend::Backend::prepare`].
    pub(in crate::backend) fn prepare(&self, plant: &Plant) -> Result<Prepared> {
        let model = &plant.model;
        let controller = &*plant.controller.unmapped(model);
        let layout = Layout { states: model.states.len(), controls: model.controls.len(), own: 0 };
        let values = model.values();
        let pack = &|network: &Mlp| self.packed(network);
        let compiled = controller.compiled(&values);
        let mut needs = Needs { model, values, layout, clock: Clock::Ignored, pack };
        let law = match (&controller.law, compiled) {
            (Law::Formula(_), Some(compiled)) => PreparedLaw::Formula(Arc::clone(compiled)),
            (Law::Formula(graph), None) => {
                let inputs = needs.inputs();
                let formula = needs.formula(graph, &inputs, layout.states, layout.first_own());
                PreparedLaw::Formula(Arc::new(formula))
            }
            (Law::Network { observe, network, act }, _) => {
                let [observe, act] = needs.around(network, [observe.as_ref(), act.as_ref()])?;
                PreparedLaw::Network { network: self.packed(network), observe, act }
            }
        };
        let system = needs.system();
        let (task, points) = (model.task, model.points);
        Ok(Prepared { system, task, points, law, layout: needs.layout, clock: needs.clock })
    }
}

impl Needs<'_> {
    /// Dynamics and margins: as compiled where they are, else as tapes.
    fn system(&mut self) -> Arc<dyn NativeSystem> {
        if let Some(compiled) = self.model.compiled() {
            return Arc::clone(compiled);
        }
        let system = InterpretedSystem::new(self.model, &self.values, self.pack);
        self.room(system.own_rows(), system.clock());
        Arc::new(system)
    }

    /// What stands around `network`: a formula before it and one behind it.
    ///
    /// The rows between are the first that formulas have to themselves. Those of the system may be the
    /// same: a decision is over before a step begins.
    fn around(
        &mut self,
        network: &Mlp,
        [observe, act]: [Option<&Graph>; 2],
    ) -> Result<[Option<Beside>; 2]> {
        let Layout { states, controls, .. } = self.layout;
        let widths = network.widths();
        let outputs = widths[widths.len() - 1];
        let seen = observe.map_or(states, |observe| observe.outputs.len());
        Packed::check(network, seen, if act.is_some() { outputs } else { controls })?;
        let first = self.layout.first_own();
        let (said, own) = (first + seen, first + seen + outputs);
        let inputs = self.inputs();
        let observe = observe.map(|graph| Beside {
            formula: self.formula(graph, &inputs, first, own),
            rows: [first, said],
        });
        let after = inputs.followed_by(said..own);
        let act = act.map(|graph| Beside {
            formula: self.formula(graph, &after, states, own),
            rows: [said, own],
        });
        self.room(own - first, Clock::Ignored);
        Ok([observe, act])
    }

    /// The inputs of a formula that makes controls.
    fn inputs(&self) -> Inputs {
        Inputs::new(self.model, &self.values, Held::Zeros)
    }

    /// The tape of `graph`, its outputs in the rows from `to` on, its own from `first_own` on.
    fn formula(
        &mut self,
        graph: &Graph,
        inputs: &Inputs,
        to: usize,
        first_own: usize,
    ) -> InterpretedFormula {
        let formula = InterpretedFormula::new(graph, inputs, to, first_own, self.pack);
        let before = first_own - self.layout.first_own();
        self.room(before + formula.own_rows(), formula.clock());
        formula
    }

    /// Makes room for `own` rows of formulas' own.
    fn room(&mut self, own: usize, clock: Clock) {
        self.layout.own = self.layout.own.max(own);
        if clock == Clock::Read {
            self.clock = clock;
        }
    }
}

impl Prepared {
    /// See [`crate::backend::Program::reach_avoid`].
    pub(in crate::backend) fn reach_avoid(
        &self,
        cpu: &Cpu,
        task: &ReachAvoidTask<'_>,
        sink: MeasureSink<'_>,
    ) -> Result<()> {
        cpu.measures(self.driven(cpu), task, sink)
    }

    /// See [`crate::backend::Program::deviation`].
    pub(in crate::backend) fn deviation(
        &self,
        cpu: &Cpu,
        task: &DeviationTask<'_>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>> {
        cpu.pairs(self.driven(cpu), task, sink)
    }

    /// The plant with the instructions of `cpu`.
    fn driven(&self, cpu: &Cpu) -> TilePlant<'_> {
        let law = match &self.law {
            PreparedLaw::Formula(formula) => TileLaw::Formula(&**formula),
            PreparedLaw::Network { network, observe, act } => {
                let [observe, act] = [observe, act].map(|beside| beside.as_ref().map(around));
                TileLaw::Network { network, observe, act }
            }
        };
        TilePlant {
            system: &*self.system,
            task: self.task,
            points: self.points,
            law,
            layout: self.layout,
            clock: self.clock,
            with: cpu.instructions,
        }
    }
}

/// A formula beside a network as a tile asks for it.
fn around(beside: &Beside) -> Around<'_> {
    Around { formula: &beside.formula, rows: beside.rows }
}
