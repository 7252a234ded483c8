//! Pairs of a task in f64, groups of them in parallel.

use rayon::prelude::*;

use crate::model::Plant;
use crate::rollout::side_by_side::{GROUP, PairGroup};
use crate::rollout::{DeviationTask, PairControl, Pairs};

/// What `of` says of each group of the pairs `indices`, in order.
pub(super) fn groups<T: Send>(
    plant: &Plant,
    pairs: &Pairs<'_>,
    indices: &[u64],
    horizon: u32,
    control: PairControl,
    of: impl Fn(&PairGroup) -> T + Sync,
) -> Vec<T> {
    let group = |indices: &[u64]| {
        let pairs: Vec<[Vec<f32>; 2]> = indices.iter().map(|index| pairs.pair(*index)).collect();
        of(&PairGroup::new(plant, &pairs, horizon, control))
    };
    indices.par_chunks(GROUP).map(group).collect()
}

/// Measures `[nominal, perturbed]` of the pairs `indices` of `task`.
pub(super) fn measures(plant: &Plant, task: &DeviationTask<'_>, indices: &[u64]) -> Vec<[f64; 2]> {
    let DeviationTask { pairs, spec, tightening, control, .. } = task;
    let of = |group: &PairGroup| group.measures(&plant.model, spec, tightening);
    groups(plant, pairs, indices, spec.horizon, *control, of).concat()
}
