//! A plant as the CPU runs it: compiled formulas, its network packed.

use std::sync::Arc;

use super::Cpu;
use super::mlp::Packed;
use super::tile::{Drive, Driven};
use crate::backend::{MeasureSink, PairSink};
use crate::error::{Error, Result};
use crate::model::{Law, Plant};
use crate::rollout::{DeviationTask, Farthest, ReachAvoidTask};
use crate::tile::{Clock, Layout, NativeFormula, NativeSystem};

/// A plant prepared for tiles.
#[derive(Debug)]
pub(in crate::backend) struct Prepared {
    system: Arc<dyn NativeSystem>,
    law: PreparedLaw,
    layout: Layout,
    clock: Clock,
}

/// Where the controls come from.
#[derive(Debug)]
enum PreparedLaw {
    Formula(Arc<dyn NativeFormula>),
    Network(Arc<Packed>),
}

impl Cpu {
    /// See [`crate::backend::Backend::prepare`].
    pub(in crate::backend) fn prepare(&self, plant: &Plant) -> Result<Prepared> {
        let Plant { model, controller } = plant;
        let missing = || Error::invalid("model", "no compiled form");
        let law = match &controller.law {
            Law::Formula(_) => {
                PreparedLaw::Formula(controller.native().cloned().ok_or_else(missing)?)
            }
            Law::Network { network, .. } => {
                Packed::check(network, model.states.len(), model.controls.len())?;
                PreparedLaw::Network(self.packed(network))
            }
        };
        Ok(Prepared {
            system: model.native.clone().ok_or_else(missing)?,
            law,
            layout: Layout { states: model.states.len(), controls: model.controls.len(), own: 0 },
            clock: Clock::Ignored,
        })
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
    fn driven(&self, cpu: &Cpu) -> Driven<'_> {
        let drive = match &self.law {
            PreparedLaw::Formula(formula) => Drive::Formula(&**formula),
            PreparedLaw::Network(network) => Drive::Network { network, observe: None, act: None },
        };
        Driven {
            system: &*self.system,
            drive,
            layout: self.layout,
            clock: self.clock,
            with: cpu.instructions,
        }
    }
}
