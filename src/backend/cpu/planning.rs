//! Plans as the CPU improves them: stages compiled or as tapes, networks packed.

use std::ops::Range;
use std::sync::Arc;

use super::Cpu;
use super::interpreted_stages::InterpretedStages;
use super::mlp::Packed;
use crate::rollout::Planning;
use crate::tile::{Layout, NativeStages};

/// What is planned for, prepared for tiles.
#[derive(Debug)]
pub(in crate::backend) struct PreparedPlanning {
    pub(super) planning: Planning,
    pub(super) stages: Arc<dyn NativeStages>,
    /// Value network and that of the disturbance, packed for the kernel.
    pub(super) networks: [Option<Arc<Packed>>; 2],
    pub(super) layout: Layout,
    /// The row of the cost so far.
    pub(super) total: usize,
    /// The row of the value.
    pub(super) value: Range<usize>,
    /// The rows of what the disturbance says.
    pub(super) pushes: Range<usize>,
    /// Whether the stages are tapes.
    interpreted: bool,
}

impl Cpu {
    /// See [`crate::backend::Backend::prepare_plans`].
    pub(in crate::backend) fn prepare_plans(&self, planning: &Planning) -> PreparedPlanning {
        let Planning { model, cost, .. } = planning;
        let states = model.states.len();
        let mut layout = Layout { states, controls: model.controls.len(), own: 0 };
        let total = layout.first_own();
        let value = total + 1..total + 2;
        let pushed = planning.disturbance.as_ref().map_or(0, |asked| asked.entries.len());
        let pushes = value.end..value.end + pushed;
        layout.own = pushes.end - total;
        let compiled = cost.compiled(model);
        let stages: Arc<dyn NativeStages> = match compiled {
            Some(compiled) => Arc::clone(compiled),
            None => {
                let stages =
                    InterpretedStages::new(model, cost, pushes.end, &|mlp| self.packed(mlp));
                layout.own += stages.rows();
                Arc::new(stages)
            }
        };
        let networks = planning.networks().map(|network| network.map(|mlp| self.packed(mlp)));
        let (planning, interpreted) = (planning.clone(), compiled.is_none());
        PreparedPlanning { planning, stages, networks, layout, total, value, pushes, interpreted }
    }
}

impl PreparedPlanning {
    /// Whether samples go step by step, in wide tiles: between networks, or by tapes.
    pub(super) fn by_the_step(&self) -> bool {
        self.interpreted || self.networks.iter().any(Option::is_some)
    }
}
