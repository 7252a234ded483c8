//! Who computed plans from which model and costs.

use crate::backend::Backend;
use crate::digest::sha256;
use crate::formula::Graph;
use crate::formula::wgsl::function;
use crate::model::{Costs, ReferenceSource};
use crate::rollout::{GENERATOR, Planning};
use crate::scenario::record::Provenance;

/// Where the results of `planning` come from; `config` is the configuration with every default.
pub(super) fn provenance(
    backend: &Backend,
    planning: &Planning,
    costs: &Costs,
    seed: u64,
    config: serde_json::Value,
) -> Provenance {
    let settings = planning.spec.settings();
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        generator: GENERATOR.to_owned(),
        config,
        policy: format!("plans of {} steps from {} samples", settings.horizon, settings.samples),
        policy_sha256: costs_sha256(costs),
        physics_sha256: sha256([planning.model.text().as_bytes()]),
        backend: backend.name().to_owned(),
        device: backend.device(),
        networks: None,
    }
}

/// SHA-256 of everything that decides what costs come to.
pub fn costs_sha256(costs: &Costs) -> String {
    sha256([costs_text(costs).as_bytes()])
}

/// Everything that decides what costs come to, as text: equal texts are equal costs.
fn costs_text(costs: &Costs) -> String {
    let whole = &costs.stage;
    let mut text = named("stage", &whole.stage);
    if let Some(terminal) = &whole.terminal {
        text += &named("terminal", &terminal.formula);
    }
    let terminal = whole.terminal.iter().filter_map(|terminal| terminal.lookups.as_ref());
    for lookups in whole.lookups.iter().chain(terminal) {
        text += &named("cells", &lookups.cells);
        for map in &lookups.maps {
            text += &bits(map.cells());
        }
    }
    for reference in &costs.references {
        text += &match &reference.source {
            ReferenceSource::Fixed(value) => bits(&[*value]),
            ReferenceSource::Formula(formula) => named("reference", formula),
            ReferenceSource::Rows(rows) => bits(rows),
        };
    }
    text
}

/// A formula as a function of its inputs.
fn named(name: &str, formula: &Graph) -> String {
    function(name, &[("inputs", formula.inputs)], formula)
}

/// Numbers by their bits, so that no decimal hides a difference.
fn bits(numbers: &[f32]) -> String {
    let each = numbers.iter().map(|number| format!("{:08x}", number.to_bits()));
    format!("// {}\n", each.collect::<Vec<_>>().join(" "))
}
