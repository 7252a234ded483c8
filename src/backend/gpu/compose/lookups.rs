//! The text by which formulas of costs ask maps.

use std::sync::Arc;

use super::glue::storage;
use super::kernels::Slot;
use super::physics_glue::{CONTROL, Outline, STATE, names_of, told};
use crate::cost::CostMap;
use crate::model::{Lookups, StageCost};

const LOOK: &str = include_str!("../../../../shaders/mppi_look.wgsl");

/// What asks the maps of a stage.
pub(super) fn stage_lookups(cost: &StageCost, outline: &Outline) -> String {
    let Some(lookups) = &cost.lookups else { return String::new() };
    // A map that charges besides declares the table itself.
    let table = if cost.map.is_some() { String::new() } else { storage(Slot::Cells, "cells") };
    table + &looked_up(lookups, cost, &told(outline, &[STATE, CONTROL]))
}

/// What asks the maps of the end.
pub(super) fn terminal_lookups(cost: &StageCost, outline: &Outline) -> String {
    let lookups = cost.terminal.as_ref().and_then(|terminal| terminal.lookups.as_ref());
    let text = lookups.map(|lookups| looked_up(lookups, cost, &told(outline, &[STATE])));
    text.map(|text| storage(Slot::Cells, "cells") + &text).unwrap_or_default()
}

/// `looked_up`: what the maps say, [`StageCost::maps`] being the table of their cells.
fn looked_up(lookups: &Lookups, cost: &StageCost, arguments: &[&str]) -> String {
    let count = lookups.maps.len();
    let answers = lookups.maps.iter().enumerate().map(|(i, map)| {
        let (first, cells) = (first_cell(cost, map), map.cells().len());
        format!("look(cell[{i}], {first}u, {cells}u)")
    });
    let answers = answers.collect::<Vec<_>>().join(", ");
    let (kind, value) = match count {
        1 => ("f32".to_owned(), answers),
        _ => (format!("array<f32, {count}>"), format!("array<f32, {count}>({answers})")),
    };
    let names = names_of(arguments);
    format!(
        "const LOOKUPS: u32 = {count}u;\n{LOOK}fn looked_up({}, t: u32) -> {kind} {{\n    \
         let cell = cells_of({names}, t);\n    return {value};\n}}\n",
        arguments.join(", ")
    )
}

/// The place of the first cell of `map` in the table.
fn first_cell(cost: &StageCost, map: &Arc<CostMap>) -> usize {
    let before = cost.maps().into_iter().take_while(|known| !Arc::ptr_eq(known, map));
    before.map(|known| known.cells().len()).sum()
}
