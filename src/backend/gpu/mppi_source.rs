//! Plans as the kernels need them, on no device yet.

use std::sync::Arc;

use super::compose::MppiText;
use super::mppi_chunking::Size;
use super::source::same_bits;
use crate::policy::Mlp;
use crate::rollout::{NoiseShape, Planning, SPLINE_SUPPORT};

/// What is planned for, printed.
pub(super) struct PlanSource {
    /// The texts of its kernels.
    pub(super) text: MppiText,
    pub(super) planning: Planning,
    /// The values of the model's parameters.
    pub(super) values: Vec<f32>,
    /// The costs of the cells of all maps, one after the other; none without a map.
    pub(super) cells: Vec<f32>,
    /// Operations of the formulas for one step of one sample.
    flops: u64,
}

impl PlanSource {
    /// Prints `planning`.
    pub(super) fn new(planning: &Planning) -> Self {
        let text = MppiText::new(planning);
        let (values, flops) = (planning.model.values(), text.operations());
        let cells = planning.cost.maps().iter().flat_map(|map| map.cells().to_vec()).collect();
        Self { text, planning: planning.clone(), values, cells, flops }
    }

    /// Whether both have the same kernels, samples and tables, bit by bit.
    pub(super) fn same(&self, other: &Self) -> bool {
        let bits = |one: &[f32], other: &[f32]| {
            bytemuck::cast_slice::<f32, u32>(one) == bytemuck::cast_slice::<f32, u32>(other)
        };
        let mut networks = self.networks().into_iter().zip(other.networks());
        self.text == other.text
            && self.planning.spec == other.planning.spec
            && bits(&self.values, &other.values)
            && bits(&self.cells, &other.cells)
            && self.spline() == other.spline()
            && networks.all(|networks| match networks {
                (None, None) => true,
                (Some(one), Some(other)) => same_bits(one, other),
                _ => false,
            })
    }

    /// Value network and disturbance network.
    pub(super) fn networks(&self) -> [Option<&Mlp>; 2] {
        self.planning.networks().map(|network| network.map(Arc::as_ref))
    }

    /// `samples` samples of each of `problems` problems, as far as they decide how to cut them up.
    pub(super) fn size(&self, problems: usize, samples: u32) -> Size<'_> {
        let Planning { model, cost, spec, .. } = &self.planning;
        Size {
            states: model.states.len(),
            controls: model.controls.len(),
            contexts: cost.contexts,
            cells: self.cells.len(),
            values: self.values.len(),
            horizon: spec.settings().horizon,
            rows: cost.rows(spec.horizon()) as u32,
            samples,
            whole: spec.settings().samples,
            problems,
            flops: self.flops,
            networks: self.networks(),
        }
    }

    /// The rows of a spline as the shaders read them; one number where there is none.
    pub(super) fn spline(&self) -> Vec<u32> {
        let NoiseShape::Spline { rows, .. } = self.planning.spec.noise().shape() else {
            return vec![0];
        };
        let words = rows.iter().flat_map(|row| {
            let weights: [u32; SPLINE_SUPPORT] = row.weights.map(f32::to_bits);
            std::iter::once(row.first).chain(weights)
        });
        words.collect()
    }
}
