//! Reach-avoid measures of a unit of starts, tile by tile.

use super::kernel::Kernel;
use super::load::Loader;
use super::rule::{Roles, Rule};
use super::tile::{Score, TilePlant, TileRunner};
use crate::model::Moment;
use crate::rollout::ReachAvoidTask;

/// Consecutive starts for one thread; twin: `shaders/reach_avoid.wgsl`.
pub(super) struct ReachAvoid<'a> {
    /// The plant.
    pub(super) plant: TilePlant<'a>,
    /// The task.
    pub(super) task: &'a ReachAvoidTask<'a>,
    /// What each step is to the plant's task.
    pub(super) roles: &'a Roles,
    /// Most trajectories in lockstep.
    pub(super) width: usize,
    /// Index of the first start.
    pub(super) first: u64,
    /// The results, one for each start.
    pub(super) out: &'a mut [f32],
}

/// The measures, by tiles of trajectories that start and end together.
pub(super) fn measures<K: Kernel, const N: usize>(
    unit: ReachAvoid<'_>,
    mut runner: TileRunner<'_, K>,
) {
    let (task, width) = (unit.task, unit.width);
    let mut frame = runner.frame();
    let mut loader = Loader::<K, N>::new(runner.kernel(), frame.states().len());
    let mut scores = vec![Score::<N>::new(); width.div_ceil(N)];
    for (tile, out) in unit.out.chunks_mut(width).enumerate() {
        let count = out.len();
        scores.fill(Score::new());
        loader.starts(&task.starts, unit.first + (tile * width) as u64, count, &mut frame);
        for t in 0..=task.spec.horizon {
            if t > 0 {
                runner.decide(&mut frame, count);
            }
            for moment in Moment::arriving(t, runner.points()) {
                if t > 0 {
                    runner.step(&mut frame, count);
                }
                runner.at(&mut frame, moment);
                let steps = [moment.step; N];
                let rule = Rule::at(task.tightening, unit.roles, &steps, moment.point);
                let scores = scores.iter_mut().map(|score| (score, rule));
                let gamma = runner.gamma(task.spec.gamma, moment.point);
                runner.judge(&mut frame, count, gamma, scores);
            }
        }
        for (out, score) in out.chunks_mut(N).zip(&scores) {
            out.copy_from_slice(&score.measure().0[..out.len()]);
        }
    }
}
