//! The text of the MPPI kernels: dynamics, cost, controls and noise of one planning.

use super::glue::{
    FINITE, PARAMS, RNG, call, component, constants, loader, recorded_pair, state_glue, storage,
};
use super::kernels::{Access, Kernel, PARTIAL_HEADER, Slot};
use super::lookups::stage_lookups;
use super::mppi_terminal::TerminalText;
use super::physics_glue::{Outline, physics_glue};
use crate::backend::physics::{Function, Part, Role};
use crate::formula::wgsl::{Arithmetic, CHOICES, careful_function, function};
use crate::formula::{Expr, Graph, record};
use crate::model::{Model, StageCost};
use crate::real::Real;
use crate::rollout::{Disturbance, MppiSpec, NoiseShape, Planning, SPLINE_SUPPORT, ValueTerm};

const NOISE: &str = include_str!("../../../../shaders/noise.wgsl");
const INDEPENDENT: &str = include_str!("../../../../shaders/noise_independent.wgsl");
const COLORED: &str = include_str!("../../../../shaders/noise_colored.wgsl");
const SPLINE: &str = include_str!("../../../../shaders/noise_spline.wgsl");
const START: &str = include_str!("../../../../shaders/mppi_start.wgsl");
const MAP: &str = include_str!("../../../../shaders/mppi_map.wgsl");
const ROLLOUT: &str = include_str!("../../../../shaders/mppi_rollout.wgsl");
const UPDATE: &str = include_str!("../../../../shaders/mppi_update.wgsl");

/// Weighted controls that a workgroup of the update holds per thread, where a step has not more.
const TILE_TERMS: usize = 32;

/// Most controls whose normal numbers are drawn without a loop.
const MOST_CALLS: usize = 4;

/// Steps that the update sums up at a time for `controls` controls.
pub(in super::super) fn tile_steps(controls: usize) -> usize {
    (TILE_TERMS / controls).max(1)
}

/// The texts of the kernels for one model, cost and setting of the noise; what changes from call to
/// call (problems, number of samples, iteration, temperature of the weights) is not part of it, nor
/// are the values of parameters, the weights of networks and the cells of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiText {
    outline: Outline,
    /// Step, stage with its places on maps, and cell of the map that charges besides.
    functions: Vec<Function>,
    /// What both kernels that draw noise need.
    noise: String,
    /// What the rollout needs besides.
    charge: String,
    /// Tables and networks that are bound besides those of every task.
    noise_table: Option<(Slot, Access)>,
    rollout_tables: Vec<(Slot, Access)>,
    /// What the end costs, where it does.
    terminal: Option<TerminalText>,
}

impl MppiText {
    /// Prints the formulas of model, cost, controls and noise of `planning`.
    pub fn new(planning: &Planning) -> Self {
        let Planning { model, cost, spec, value, disturbance } = planning;
        let outline = Outline {
            points: 1,
            states: model.states.len(),
            controls: model.controls.len(),
            parameters: model.parameters.len(),
            period: model.period.unwrap_or(0.0),
            contexts: cost.contexts,
            driving: None,
        };
        let functions = rollout_functions(model, cost);
        let (states, tables) = (outline.states, rollout_tables(planning, &functions));
        let terminal = cost.terminal.as_ref();
        Self {
            terminal: terminal.map(|terminal| TerminalText::new(model, cost, terminal, &outline)),
            functions,
            noise: noise_text(spec, cost.contexts),
            charge: [
                charge_text(cost, spec),
                stage_lookups(cost, &outline),
                value_text(value.as_ref()),
                push_text(states, disturbance.as_ref()),
            ]
            .concat(),
            noise_table: match spec.noise().shape() {
                NoiseShape::Independent => None,
                NoiseShape::Colored { .. } => Some((Slot::Carry, Access::ReadWrite)),
                NoiseShape::Spline { .. } => Some((Slot::Spline, Access::Read)),
            },
            rollout_tables: tables,
            outline,
        }
    }

    /// The kernels that it has texts of.
    pub fn kernels(&self) -> impl Iterator<Item = Kernel> {
        Kernel::MPPI.into_iter().chain(self.terminal.as_ref().map(|_| Kernel::MppiTerminal))
    }

    /// What `kernel` binds.
    pub fn bindings(&self, kernel: Kernel) -> Vec<(Slot, Access)> {
        if let (Kernel::MppiTerminal, Some(terminal)) = (kernel, &self.terminal) {
            return terminal.bindings();
        }
        let mut list = kernel.bindings(false);
        if kernel != Kernel::MppiStart {
            list.extend(self.noise_table);
        }
        if kernel == Kernel::MppiRollout {
            list.extend(&self.rollout_tables);
        }
        list
    }

    /// The WGSL module of `kernel`, one of [`MppiText::kernels`].
    ///
    /// # Panics
    /// For any other kernel.
    pub fn compose(&self, kernel: Kernel) -> String {
        if let (Kernel::MppiTerminal, Some(terminal)) = (kernel, &self.terminal) {
            return terminal.compose();
        }
        let Outline { states, controls, .. } = self.outline;
        let state = state_glue(states);
        let parts = match kernel {
            Kernel::MppiStart => {
                vec![loader("start_of", "array<f32, NX>", "starts", states, 0..states), state]
            }
            Kernel::MppiRollout => vec![state, self.noise.clone(), self.rollout()],
            Kernel::MppiUpdate => {
                vec![FINITE.to_owned(), self.noise.clone(), update_text(controls)]
            }
            other => panic!("{other:?} is not a kernel of MPPI"),
        };
        let body = match kernel {
            Kernel::MppiStart => START,
            Kernel::MppiRollout => ROLLOUT,
            _ => UPDATE,
        };
        let sizes = constants(states, controls);
        let shared = vec![sizes, PARAMS.to_owned(), CHOICES.to_owned()];
        [shared, parts, vec![body.to_owned()]].concat().join("\n")
    }

    /// Operations of the formulas for one step: a line of the text is one.
    pub(in super::super) fn operations(&self) -> u64 {
        self.compose(Kernel::MppiRollout).lines().count() as u64
    }

    /// What the rollout calls besides the noise.
    fn rollout(&self) -> String {
        let contexts = self.outline.contexts;
        let mut text = String::new();
        if contexts > 0 {
            text += &format!("const CONTEXTS: u32 = {contexts}u;\n");
            let controls = self.outline.controls;
            let row = controls + contexts;
            text += &loader("context_at", "array<f32, CONTEXTS>", "plans", row, controls..row);
        }
        let functions: Vec<&Function> = self.functions.iter().collect();
        [text, physics_glue(&self.outline, &functions), self.charge.clone()].concat()
    }
}

/// What the rollout binds besides what every one does.
fn rollout_tables(planning: &Planning, functions: &[Function]) -> Vec<(Slot, Access)> {
    let Planning { cost, value, disturbance, .. } = planning;
    let reads = functions.iter().any(|function| function.reads(Part::Parameters));
    let read = |slot| (slot, Access::Read);
    let mut tables = vec![];
    let maps = cost.map.is_some() || cost.lookups.is_some();
    tables.extend(maps.then(|| read(Slot::Cells)));
    tables.extend(value.as_ref().map(|_| read(Slot::Value)));
    tables.extend(disturbance.as_ref().map(|_| read(Slot::Push)));
    tables.extend(reads.then_some((Slot::Values, Access::Constant)));
    tables
}

/// The functions of the rollout: step, stage with its places on maps, cell of a map.
fn rollout_functions(model: &Model, cost: &StageCost) -> Vec<Function> {
    let asked = cost.lookups.as_ref().map_or(0, |lookups| lookups.maps.len());
    let stage = [0, cost.contexts, asked];
    let told = [0, cost.contexts, 0];
    let mut functions = vec![
        Function::of(model, Role::Step, &model.step, [0; 3]),
        Function::of(model, Role::Stage, &cost.stage, stage),
    ];
    let cell = cost.map.iter().map(|map| Function::of(model, Role::Cell, &map.cell, [0; 3]));
    functions.extend(cell);
    let places = cost.lookups.iter();
    functions.extend(places.map(|all| Function::of(model, Role::StagePlaces, &all.cells, told)));
    functions
}

/// The generator, the shape of the noise and the controls that it makes of a plan.
fn noise_text(spec: &MppiSpec, contexts: usize) -> String {
    let controls = spec.controls();
    let noise = spec.noise();
    let antithetic = noise.antithetic();
    let (shape, recorded) = match noise.shape() {
        NoiseShape::Independent => (INDEPENDENT, String::new()),
        NoiseShape::Colored { keep, fresh } => {
            (COLORED, recorded_recurrence(controls, *keep, *fresh))
        }
        NoiseShape::Spline { .. } => (SPLINE, recorded_mixture(controls)),
    };
    [
        format!("const ANTITHETIC: bool = {antithetic};\n"),
        RNG.to_owned(),
        // A plan weighs the numbers that it drew: they need not have the bits of the host.
        recorded_pair(Arithmetic::Apart),
        NOISE.to_owned(),
        draw(controls),
        recorded,
        shape.to_owned(),
        loader("plan_at", "array<f32, NU>", "plans", controls + contexts, 0..controls),
        recorded_control(spec),
    ]
    .join("\n")
}

/// `draw`: the normal numbers of a step or knot, in ascending order; many of them in a loop, since
/// the text of the generator is compiled wherever it is called.
fn draw(controls: usize) -> String {
    let mut text = String::from("fn draw(number: u32) -> array<f32, NU> {\n");
    if controls > MOST_CALLS {
        return text
            + "    var z: array<f32, NU>;\n    for (var i = 0u; i < NU; i += 1u) {\n        \
               z[i] = normal(number * NU + i);\n    }\n    return z;\n}\n";
    }
    for i in 0..controls {
        text += &format!("    let z{i} = normal(number * NU + {i}u);\n");
    }
    let all: Vec<String> = (0..controls).map(|i| format!("z{i}")).collect();
    text + &format!("    return array<f32, NU>({});\n}}\n", all.join(", "))
}

/// `recurrence`: the next of correlated numbers.
fn recorded_recurrence(count: usize, keep: f32, fresh: f32) -> String {
    let graph = record(2 * count, |both| {
        let next = |i: usize| Expr::lit(keep) * both[i] + Expr::lit(fresh) * both[count + i];
        (0..count).map(next).collect()
    });
    let arguments = [("before", "array<f32, NU>", count), ("fresh", "array<f32, NU>", count)];
    both("recurrence", "recorded_recurrence", &arguments, "array<f32, NU>", count, &graph)
}

/// `mixture`: the weighted sum of four knots.
fn recorded_mixture(count: usize) -> String {
    let graph = record(SPLINE_SUPPORT * (1 + count), |inputs| {
        let (weights, knots) = inputs.split_at(SPLINE_SUPPORT);
        let mixed = |i: usize| {
            weights
                .iter()
                .enumerate()
                .fold(Expr::lit(0.0), |sum, (knot, &weight)| sum + weight * knots[knot * count + i])
        };
        (0..count).map(mixed).collect()
    });
    let knot = |name| (name, "array<f32, NU>", count);
    let weights = ("weights", "array<f32, 4>", SPLINE_SUPPORT);
    let arguments = [weights, knot("a"), knot("b"), knot("c"), knot("d")];
    both("mixture", "recorded_mixture", &arguments, "array<f32, NU>", count, &graph)
}

/// `control_at`: the plan, its noise added, clipped.
fn recorded_control(spec: &MppiSpec) -> String {
    let (count, bounds) = (spec.controls(), &spec.settings().bounds);
    let graph = record(2 * count, |inputs| {
        let (plan, z) = inputs.split_at(count);
        let control = |i: usize| {
            let factor = |j: usize| spec.noise().factor(i, j);
            let own = Expr::lit(factor(i)) * z[i];
            let noise = (0..i)
                .filter(|&j| factor(j) != 0.0)
                .fold(own, |sum, j| sum + Expr::lit(factor(j)) * z[j]);
            let [low, high] = bounds[i].map(Expr::lit);
            (plan[i] + noise).clamp(low, high)
        };
        (0..count).map(control).collect()
    });
    let arguments = [("nominal", "array<f32, NU>", count), ("z", "array<f32, NU>", count)];
    both("control_at", "recorded_control", &arguments, "array<f32, NU>", count, &graph)
}

/// `charge`: the cost so far with that of a stage, of its noise where noise costs, and of its place
/// on the map where there is one.
fn charge_text(cost: &StageCost, spec: &MppiSpec) -> String {
    let context = if cost.contexts > 0 { "context_at(stage), " } else { "" };
    let mut text = String::new();
    let mut sum = format!("total + staged(x, u, {context}t)");
    if let Some(penalty) = spec.penalty() {
        text += &recorded_noise_cost(penalty, spec.controls());
        sum = format!("({sum}) + noise_cost(nominal, u)");
    }
    if let Some(map) = &cost.map {
        text += &format!("const CELLS: u32 = {}u;\n", map.map.cells().len());
        text += &storage(Slot::Cells, "cells");
        text += MAP;
        sum = format!("({sum}) + map_cost(x, t)");
    }
    text + &format!(
        "fn charge(\n    total: f32,\n    x: array<f32, NX>,\n    u: array<f32, NU>,\n    \
         stage: u32,\n    nominal: array<f32, NU>,\n    t: u32,\n) -> f32 \
         {{\n    return {sum};\n}}\n"
    )
}

/// `noise_cost`: `lambda plan' Sigma^-1 (u - plan)`.
fn recorded_noise_cost(penalty: &[f32], count: usize) -> String {
    let graph = record(2 * count, |inputs| {
        let (plan, u) = inputs.split_at(count);
        let row = |i: usize| {
            (0..count)
                .fold(Expr::lit(0.0), |row, j| row + Expr::lit(penalty[j * count + i]) * plan[j])
        };
        let cost = |cost, i: usize| cost + row(i) * (u[i] - plan[i]);
        vec![(0..count).fold(Expr::lit(0.0), cost)]
    });
    let arguments = [("nominal", "array<f32, NU>", count), ("u", "array<f32, NU>", count)];
    both("noise_cost", "recorded_noise_cost", &arguments, "f32", 1, &graph)
}

/// `charge_value`: the cost so far with the penalty on the value.
fn value_text(term: Option<&ValueTerm>) -> String {
    let Some(term) = term else {
        return "fn charge_value(column: u32, total: f32) -> f32 {\n    return total;\n}\n".into();
    };
    let graph = record(2, |inputs| {
        let short = (Expr::lit(term.threshold) - inputs[1]).max(Expr::lit(0.0));
        vec![inputs[0] + Expr::lit(term.weight) * (short * short)]
    });
    let recorded = function("value_cost", &[("total", 1), ("value", 1)], &graph);
    let slot = Slot::Value as u32;
    format!(
        "{recorded}@group(0) @binding({slot}) var<storage, read> value: array<vec4<f32>>;\n\
         fn charge_value(column: u32, total: f32) -> f32 {{\n    \
         return value_cost(total, value[column].x);\n}}\n"
    )
}

/// `disturb`: the state pushed by the disturbance.
fn push_text(states: usize, disturbance: Option<&Disturbance>) -> String {
    let head = "fn disturb(column: u32, x: array<f32, NX>) -> array<f32, NX> {\n";
    let Some(disturbance) = disturbance else {
        return format!("{head}    return x;\n}}\n");
    };
    let outputs = disturbance.entries.len();
    let graph = record(states + outputs, |inputs| {
        let mut x = inputs[..states].to_vec();
        for ((state, scale), push) in disturbance.entries.iter().zip(&inputs[states..]) {
            x[*state] = x[*state] + Expr::lit(*scale) * *push;
        }
        x
    });
    let arguments = [("x", "array<f32, NX>", states), ("d", "array<f32, PUSHES>", outputs)];
    let recorded = both("pushed", "recorded_push", &arguments, "array<f32, NX>", states, &graph);
    let slot = Slot::Push as u32;
    let mut text = format!(
        "const PUSHES: u32 = {outputs}u;\n{recorded}\
         @group(0) @binding({slot}) var<storage, read> push: array<vec4<f32>>;\n{head}"
    );
    for quad in 0..outputs.div_ceil(4) {
        text += &format!("    let v{quad} = push[{quad}u * params.stride + column];\n");
    }
    let all: Vec<String> = (0..outputs).map(component).collect();
    text + &format!("    return pushed(x, array<f32, PUSHES>({}));\n}}\n", all.join(", "))
}

/// Sizes of the update, the exponential of its weights, and `put_terms`.
fn update_text(controls: usize) -> String {
    let tile = tile_steps(controls);
    let exponential = record(1, |x| vec![x[0].exp_negative()]);
    let mut text = format!(
        "const PARTIAL_HEADER: u32 = {PARTIAL_HEADER}u;\nconst TILE_STEPS: u32 = {tile}u;\n{}\
         fn put_terms(lane: u32, step: u32, weight: f32, u: array<f32, NU>) {{\n",
        function("exp_negative", &[("x", 1)], &exponential)
    );
    for i in 0..controls {
        let row = format!("(step * NU + {i}u)");
        text += &format!("    terms[{row} * TERM_PITCH + lane] = weight * u[{i}];\n");
    }
    text + "}\n"
}

/// The recorded function, and the one that calls it and returns its `length` numbers as a `kind`.
fn both(
    name: &str,
    recorded: &str,
    arguments: &[(&str, &str, usize)],
    kind: &str,
    length: usize,
    graph: &Graph,
) -> String {
    let inputs: Vec<(&str, usize)> =
        arguments.iter().map(|(name, _, length)| (*name, *length)).collect();
    let text = careful_function(recorded, &inputs, graph);
    [text, call(name, recorded, arguments, kind, length)].concat()
}
