//! What a record is of, and who computed it from which input.

use super::record::{Provenance, SystemRecord};
use crate::backend::Program;
use crate::digest;
use crate::model::{Model, Plant};
use crate::policy::Mlp;
use crate::rollout::GENERATOR;

/// Who computed what from which input.
pub(crate) fn provenance(
    program: &Program<'_>,
    seed: u64,
    config: serde_json::Value,
) -> Provenance {
    let (plant, backend) = (program.plant(), program.backend());
    let Hashes { physics_sha256, policy_sha256 } = hashes(plant);
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        generator: GENERATOR.to_owned(),
        config,
        policy: plant.controller.name.clone(),
        policy_sha256,
        physics_sha256,
        backend: backend.name().to_owned(),
        device: backend.device(),
        networks: program.networks(),
    }
}

/// What tells plants apart, in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hashes {
    /// SHA-256 of the recorded physics.
    pub physics_sha256: String,
    /// SHA-256 of the policy.
    pub policy_sha256: String,
}

/// SHA-256 of the recorded physics and of the policy.
pub fn hashes(plant: &Plant) -> Hashes {
    let physics_sha256 = digest::sha256([plant.text().as_bytes()]);
    // A formula is part of the recorded text.
    let network = plant.controller.network();
    let policy_sha256 = network.map_or_else(|| physics_sha256.clone(), Mlp::digest);
    Hashes { physics_sha256, policy_sha256 }
}

/// Names, boxes and bodies of the system, with the box of starts from the corner `low` to `high`.
pub(crate) fn system_record(model: &Model, low: &[f32], high: &[f32]) -> SystemRecord {
    let mut states = model.states.clone();
    for (axis, (low, high)) in states.iter_mut().zip(low.iter().zip(high)) {
        (axis.low, axis.high) = (*low, *high);
    }
    SystemRecord {
        name: model.name.clone(),
        states,
        controls: model.controls.clone(),
        bodies: model.bodies.clone(),
        task: model.task,
        between: model.points - 1,
    }
}
