//! From runs to their record.

use super::closed_loop::{ClosedLoop, Flown};
use super::judged::Judged;
use super::notes::notes;
use super::origin::provenance;
use super::record::{
    CostRecord, EffectiveRecord, LatencyRecord, PLAN_SCHEMA, PlanRecord, PlansRecord, RunRecord,
    SuccessRecord,
};
use super::settings::PlanSettings;
use crate::backend::Backend;
use crate::model::{Costs, Model};
use crate::rollout::RolloutSpec;
use crate::scenario::system_record;

/// What runs came from, beside the closed loop itself.
#[derive(Clone, Debug)]
pub struct Setting<'a> {
    /// Who ran it.
    pub backend: &'a Backend,
    /// The model as the task looks at it, its points with it.
    pub model: &'a Model,
    /// The costs.
    pub costs: &'a Costs,
    /// How plans are made.
    pub settings: &'a PlanSettings,
    /// Steps and discount.
    pub spec: RolloutSpec,
    /// Ends of the box that starts are drawn from, `[states]` each.
    pub bounds: [Vec<f32>; 2],
    /// Seed of starts and noise.
    pub seed: u64,
    /// The configuration with every default.
    pub config: serde_json::Value,
}

impl Setting<'_> {
    /// The record of the runs of `closed_loop`.
    pub fn record(
        &self,
        closed_loop: &ClosedLoop<'_>,
        flown: &Flown,
        judged: &[Judged],
    ) -> PlanRecord {
        let (planning, costs) = (closed_loop.planning(), self.costs);
        let model = self.model;
        let each = flown.runs.iter().zip(judged);
        let runs: Vec<_> = each.map(|(run, judged)| RunRecord::new(costs, run, judged)).collect();
        let effective = flown.runs.iter().flat_map(|run| &run.effective).copied();
        let PlanSettings { iterations, first_plan, .. } = *self.settings;
        let mut record = PlanRecord {
            schema: PLAN_SCHEMA,
            provenance: provenance(self.backend, planning, costs, self.seed, self.config.clone()),
            system: system_record(model, &self.bounds[0], &self.bounds[1]),
            steps: self.spec.horizon,
            period: model.period,
            gamma: self.spec.gamma,
            plans: PlansRecord::new(&planning.spec, iterations, first_plan),
            success: SuccessRecord::new(judged),
            cost: CostRecord::new(costs, &runs),
            effective: EffectiveRecord::new(effective),
            latency: LatencyRecord::new(flown),
            runs,
            notes: Vec::new(),
            events: self.backend.events(),
        };
        let lost = flown.runs.iter().flat_map(|run| &run.non_finite);
        record.notes = notes(model, costs, &record, lost.map(|count| u64::from(*count)).sum());
        record
    }
}
