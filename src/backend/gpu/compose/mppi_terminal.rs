//! The text of the kernel that adds what the end of a plan costs.

use super::glue::{PARAMS, constants, load_glue, loader, storage};
use super::kernels::{Access, Kernel, Slot};
use super::lookups::terminal_lookups;
use super::physics_glue::{Outline, physics_glue};
use crate::backend::physics::{Function, Part, Role};
use crate::formula::wgsl::CHOICES;
use crate::model::{Model, StageCost, TerminalCost};

const TERMINAL: &str = include_str!("../../../../shaders/mppi_terminal.wgsl");

/// What the kernel of the end is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TerminalText {
    outline: Outline,
    /// The cost, and the places on the maps that it asks.
    functions: Vec<Function>,
    /// What asks the maps.
    lookups: String,
    tables: Vec<(Slot, Access)>,
}

impl TerminalText {
    /// Prints `terminal`, which is that of `cost`.
    pub(super) fn new(
        model: &Model,
        cost: &StageCost,
        terminal: &TerminalCost,
        outline: &Outline,
    ) -> Self {
        let TerminalCost { formula, lookups } = terminal;
        let asked = lookups.as_ref().map_or(0, |lookups| lookups.maps.len());
        let mut functions =
            vec![Function::of(model, Role::Terminal, formula, [0, cost.contexts, asked])];
        let more = [0, cost.contexts, 0];
        let places =
            lookups.iter().map(|all| Function::of(model, Role::TerminalPlaces, &all.cells, more));
        functions.extend(places);
        let reads = functions.iter().any(|function| function.reads(Part::Parameters));
        let tables = [
            (cost.contexts > 0).then_some((Slot::Plans, Access::Read)),
            lookups.as_ref().map(|_| (Slot::Cells, Access::Read)),
            reads.then_some((Slot::Values, Access::Constant)),
        ];
        Self {
            outline: outline.clone(),
            functions,
            lookups: terminal_lookups(cost, outline),
            tables: tables.into_iter().flatten().collect(),
        }
    }

    /// What the kernel binds.
    pub(super) fn bindings(&self) -> Vec<(Slot, Access)> {
        [Kernel::MppiTerminal.bindings(false), self.tables.clone()].concat()
    }

    /// The WGSL module.
    pub(super) fn compose(&self) -> String {
        let Outline { states, controls, contexts, .. } = self.outline;
        let functions: Vec<&Function> = self.functions.iter().collect();
        [
            constants(states, controls),
            PARAMS.to_owned(),
            CHOICES.to_owned(),
            load_glue(states, &[]),
            rows(controls, contexts),
            self.lookups.clone() + &physics_glue(&self.outline, &functions),
            TERMINAL.to_owned(),
        ]
        .join("\n")
    }
}

/// `terminal_of`: the cost of a state at a time, told what row `row` of the plans says.
fn rows(controls: usize, contexts: usize) -> String {
    let (mut text, mut told) = (String::new(), "");
    if contexts > 0 {
        let row = controls + contexts;
        text += &format!("const CONTEXTS: u32 = {contexts}u;\n");
        text += &storage(Slot::Plans, "plans");
        text += &loader("context_at", "array<f32, CONTEXTS>", "plans", row, controls..row);
        told = "context_at(row), ";
    }
    text + &format!(
        "fn terminal_of(x: array<f32, NX>, row: u32, t: u32) -> f32 {{\n    \
         return ended(x, {told}t);\n}}\n"
    )
}
