//! Whether the formulas of a plant are such that kernels can run them.

use super::physics_glue::DrivingNetwork;
use crate::backend::physics::{Part, Physics, Role};
use crate::error::{Error, Result};
use crate::model::{Controller, Law, Model};

/// The sizes of every formula must be those of its place: kernels do not check.
pub(super) fn check_formulas(model: &Model, controller: &Controller) -> Result<()> {
    let (inputs, states, controls) = (model.inputs(), model.states.len(), model.controls.len());
    let mut expected = vec![
        ("step", &model.step, [inputs, states]),
        ("target", &model.target, [inputs, 1]),
        ("constraint", &model.constraint, [inputs, 1]),
    ];
    if let Law::Formula(graph) = &controller.law {
        expected.push(("control", graph, [inputs, controls]));
    }
    if let Law::Network { observe, network, act } = &controller.law {
        let DrivingNetwork { inputs: seen, outputs: said, .. } = DrivingNetwork::new(network);
        check_network(
            observe.is_some() || seen == states,
            act.is_some() || said == controls,
            || {
                format!(
                    "maps {seen} inputs to {said} outputs; the system has {states} states and \
                 {controls} controls"
                )
            },
        )?;
        expected.extend(observe.iter().map(|graph| ("observe", graph, [inputs, seen])));
        expected.extend(act.iter().map(|graph| ("act", graph, [inputs + said, controls])));
    }
    for (place, graph, sizes) in expected {
        let found = [graph.inputs, graph.outputs.len()];
        if found != sizes {
            let problem = format!(
                "maps {} inputs to {} outputs; {} to {} were expected",
                found[0], found[1], sizes[0], sizes[1]
            );
            return Err(Error::invalid(place, problem));
        }
    }
    Ok(())
}

/// Refuses points inside a period where formulas call networks, which go from kernel to kernel.
pub(super) fn check_points(model: &Model) -> Result<()> {
    if model.points == 1 {
        return Ok(());
    }
    let problem = "adapters do not look at points inside a period where formulas call networks; use the native \
                   CPU backend, or leave it out";
    Err(Error::invalid("model.task.between", problem))
}

fn check_network(inputs: bool, outputs: bool, problem: impl FnOnce() -> String) -> Result<()> {
    if inputs && outputs { Ok(()) } else { Err(Error::invalid("network", problem())) }
}

/// Only the step knows the controls.
pub(super) fn check_reads(physics: &Physics) -> Result<()> {
    let reads = |role| role != Role::Step;
    match physics.functions.iter().find(|one| reads(one.role) && one.reads(Part::Control)) {
        None => Ok(()),
        Some(function) => {
            let problem = "reads a control, which only the step knows";
            Err(Error::invalid(function.role.name(), problem))
        }
    }
}
