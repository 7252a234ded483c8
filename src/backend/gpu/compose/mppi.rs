//! The text of the MPPI kernels: recorded dynamics, cost, controls and noise of one task.

use std::array::from_fn;

use super::glue::{FINITE, PARAMS, RNG, call, component, constants, recorded_pair, state_glue};
use super::kernels::{Access, Kernel, PARTIAL_HEADER, Slot};
use crate::cost::{Cost, CostMap};
use crate::formula::wgsl::{CHOICES, function};
use crate::formula::{Expr, Graph, record};
use crate::real::Real;
use crate::rollout::{Disturbance, MppiSpec, MppiTask, NoiseShape, SPLINE_SUPPORT, ValueTerm};
use crate::system::System;

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

/// The texts of the kernels for one system, cost and setting of the noise; what changes from call
/// to call (problems, number of samples, iteration, temperature of the weights) is not part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiText {
    states: usize,
    controls: usize,
    /// What both kernels that draw noise need.
    noise: String,
    /// What the rollout needs besides.
    rollout: String,
    /// Tables and networks that are bound besides those of every task.
    noise_table: Option<(Slot, Access)>,
    networks: Vec<(Slot, Access)>,
}

impl MppiText {
    /// Records dynamics, cost, controls and noise of `task`.
    pub fn new<S, C, const NX: usize, const NU: usize, const NC: usize>(
        system: &S,
        cost: &C,
        task: &MppiTask<'_, NX, NU, NC>,
    ) -> Self
    where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        let value = task.value.map(|_| (Slot::Value, Access::Read));
        let push = task.disturbance.map(|_| (Slot::Push, Access::Read));
        Self {
            states: NX,
            controls: NU,
            noise: noise_text(task.spec),
            rollout: [
                recorded_step::<_, NX, NU>(system),
                charge_text::<_, NX, NU, NC>(cost, task.spec),
                value_text(task.value.as_ref()),
                push_text::<NX>(task.disturbance.as_ref()),
            ]
            .concat(),
            noise_table: match task.spec.noise().shape() {
                NoiseShape::Independent => None,
                NoiseShape::Colored { .. } => Some((Slot::Carry, Access::ReadWrite)),
                NoiseShape::Spline { .. } => Some((Slot::Spline, Access::Read)),
            },
            networks: value.into_iter().chain(push).collect(),
        }
    }

    /// What `kernel` binds.
    pub fn bindings(&self, kernel: Kernel) -> Vec<(Slot, Access)> {
        let mut list = kernel.bindings(false);
        if kernel != Kernel::MppiStart {
            list.extend(self.noise_table);
        }
        if kernel == Kernel::MppiRollout {
            list.extend(&self.networks);
        }
        list
    }

    /// The WGSL module of `kernel`, one of [`Kernel::MPPI`].
    ///
    /// # Panics
    /// For any other kernel.
    pub fn compose(&self, kernel: Kernel) -> String {
        let state = state_glue(self.states);
        let parts = match kernel {
            Kernel::MppiStart => {
                vec![loader("start_of", "State", ("starts", 0), self.states), state]
            }
            Kernel::MppiRollout => vec![state, self.noise.clone(), self.rollout.clone()],
            Kernel::MppiUpdate => {
                vec![FINITE.to_owned(), self.noise.clone(), update_text(self.controls)]
            }
            other => panic!("{other:?} is not a kernel of MPPI"),
        };
        let body = match kernel {
            Kernel::MppiStart => START,
            Kernel::MppiRollout => ROLLOUT,
            _ => UPDATE,
        };
        let sizes = constants(self.states, self.controls);
        let shared = vec![sizes, PARAMS.to_owned(), CHOICES.to_owned()];
        [shared, parts, vec![body.to_owned()]].concat().join("\n")
    }
}

/// The generator, the shape of the noise and the controls that it makes of a plan.
fn noise_text<const NU: usize>(spec: &MppiSpec<NU>) -> String {
    let noise = spec.noise();
    let antithetic = noise.antithetic();
    let (shape, recorded) = match noise.shape() {
        NoiseShape::Independent => (INDEPENDENT, String::new()),
        NoiseShape::Colored { keep, fresh } => (COLORED, recorded_recurrence::<NU>(*keep, *fresh)),
        NoiseShape::Spline { .. } => (SPLINE, recorded_mixture::<NU>()),
    };
    [
        format!("const ANTITHETIC: bool = {antithetic};\n"),
        RNG.to_owned(),
        recorded_pair(),
        NOISE.to_owned(),
        draw(NU),
        recorded,
        shape.to_owned(),
        loader("plan_at", "Control", ("plans", 0), NU),
        recorded_control(spec),
    ]
    .join("\n")
}

/// `draw`: the normal numbers of a step or knot, in ascending order; many of them in a loop, since
/// the text of the generator is compiled wherever it is called.
fn draw(controls: usize) -> String {
    let mut text = String::from("fn draw(number: u32) -> Control {\n");
    if controls > MOST_CALLS {
        return text
            + "    var z: Control;\n    for (var i = 0u; i < NU; i += 1u) {\n        \
               z[i] = normal(number * NU + i);\n    }\n    return z;\n}\n";
    }
    for i in 0..controls {
        text += &format!("    let z{i} = normal(number * NU + {i}u);\n");
    }
    let all: Vec<String> = (0..controls).map(|i| format!("z{i}")).collect();
    text + &format!("    return Control({});\n}}\n", all.join(", "))
}

/// A function that loads row `row` of a table of rows of `length` numbers, which `ahead` others
/// precede.
fn loader(name: &str, kind: &str, (table, ahead): (&str, usize), length: usize) -> String {
    let alias = if kind == "Context" {
        format!("alias Context = array<f32, {length}>;\n")
    } else {
        String::new()
    };
    let all: Vec<String> = (0..length).map(|i| format!("{table}[at + {i}u]")).collect();
    let ahead = if ahead > 0 { format!("{ahead}u + ") } else { String::new() };
    format!(
        "{alias}fn {name}(row: u32) -> {kind} {{\n    let at = {ahead}row * {length}u;\n    \
         return {kind}({});\n}}\n",
        all.join(", ")
    )
}

/// `recurrence`: the next of correlated numbers.
fn recorded_recurrence<const NU: usize>(keep: f32, fresh: f32) -> String {
    let graph = record(2 * NU, |both| {
        let next = |i: usize| Expr::lit(keep) * both[i] + Expr::lit(fresh) * both[NU + i];
        (0..NU).map(next).collect()
    });
    let arguments = [("before", "Control", NU), ("fresh", "Control", NU)];
    both("recurrence", "recorded_recurrence", &arguments, ("Control", NU), &graph)
}

/// `mixture`: the weighted sum of four knots.
fn recorded_mixture<const NU: usize>() -> String {
    let graph = record(SPLINE_SUPPORT * (1 + NU), |inputs| {
        let (weights, knots) = inputs.split_at(SPLINE_SUPPORT);
        let mixed = |i: usize| {
            weights
                .iter()
                .enumerate()
                .fold(Expr::lit(0.0), |sum, (knot, &weight)| sum + weight * knots[knot * NU + i])
        };
        (0..NU).map(mixed).collect()
    });
    let knot = |name| (name, "Control", NU);
    let weights = ("weights", "array<f32, 4>", SPLINE_SUPPORT);
    let arguments = [weights, knot("a"), knot("b"), knot("c"), knot("d")];
    both("mixture", "recorded_mixture", &arguments, ("Control", NU), &graph)
}

/// `control_at`: the plan, its noise added, clipped.
fn recorded_control<const NU: usize>(spec: &MppiSpec<NU>) -> String {
    let (factor, bounds) = (spec.noise().factor(), spec.settings().bounds);
    let graph = record(2 * NU, |inputs| {
        let (plan, z) = inputs.split_at(NU);
        let control = |i: usize| {
            let own = Expr::lit(factor[i][i]) * z[i];
            let noise = (0..i)
                .filter(|&j| factor[i][j] != 0.0)
                .fold(own, |sum, j| sum + Expr::lit(factor[i][j]) * z[j]);
            let [low, high] = bounds[i].map(Expr::lit);
            (plan[i] + noise).clamp(low, high)
        };
        (0..NU).map(control).collect()
    });
    let arguments = [("nominal", "Control", NU), ("z", "Control", NU)];
    both("control_at", "recorded_control", &arguments, ("Control", NU), &graph)
}

/// `advance`: the dynamics.
fn recorded_step<S, const NX: usize, const NU: usize>(system: &S) -> String
where
    S: System<NX, NU>,
{
    let graph = record(NX + NU, |inputs| {
        system.step(from_fn(|i| inputs[i]), from_fn(|i| inputs[NX + i])).to_vec()
    });
    let arguments = [("x", "State", NX), ("u", "Control", NU)];
    both("advance", "plant_step", &arguments, ("State", NX), &graph)
}

/// `charge` and the contexts that it wants: the cost so far with that of a stage and of its place
/// on the map where there is one.
fn charge_text<C, const NX: usize, const NU: usize, const NC: usize>(
    cost: &C,
    spec: &MppiSpec<NU>,
) -> String
where
    C: Cost<NX, NU, NC>,
{
    let cells = map_of(cost).map_or(0, |map| map.cells().len());
    let contexts = loader("context_at", "Context", ("contexts", cells), NC);
    if cells == 0 {
        return [recorded_charge("charge", cost, spec), contexts].concat();
    }
    let constants = format!("const CELLS: u32 = {cells}u;\n");
    let staged = recorded_charge("charge_stage", cost, spec);
    [constants, staged, contexts, recorded_cell(cost), MAP.to_owned()].concat()
}

/// The map of a cost.
pub(in super::super) fn map_of<C, const NX: usize, const NU: usize, const NC: usize>(
    cost: &C,
) -> Option<&CostMap>
where
    C: Cost<NX, NU, NC>,
{
    cost.map([0.0_f32; NX]).map(|(map, _)| map)
}

/// `cell_at`: the number of the map's cell at a state.
fn recorded_cell<C, const NX: usize, const NU: usize, const NC: usize>(cost: &C) -> String
where
    C: Cost<NX, NU, NC>,
{
    let looked_up = |x: &[Expr]| cost.map::<Expr>(from_fn(|i| x[i])).map(|(map, at)| map.cell(at));
    let graph = record(NX, |x| looked_up(x).into_iter().collect());
    both("cell_at", "map_cell", &[("x", "State", NX)], ("f32", 1), &graph)
}

/// The function `name`: the cost so far with that of a stage, and of its noise where noise costs.
fn recorded_charge<C, const NX: usize, const NU: usize, const NC: usize>(
    name: &str,
    cost: &C,
    spec: &MppiSpec<NU>,
) -> String
where
    C: Cost<NX, NU, NC>,
{
    let graph = record(1 + NX + NU + NC + NU, |inputs| {
        let (total, rest) = (inputs[0], &inputs[1..]);
        let u: [Expr; NU] = from_fn(|i| rest[NX + i]);
        let plan: [Expr; NU] = from_fn(|i| rest[NX + NU + NC + i]);
        let context = from_fn(|i| rest[NX + NU + i]);
        let staged = total + cost.stage(from_fn(|i| rest[i]), u, context);
        vec![match spec.penalty() {
            None => staged,
            Some(penalty) => staged + noise_cost(penalty, &plan, &u),
        }]
    });
    let arguments = [
        ("total", "f32", 1),
        ("x", "State", NX),
        ("u", "Control", NU),
        ("context", "Context", NC),
        ("nominal", "Control", NU),
    ];
    both(name, "stage_cost", &arguments, ("f32", 1), &graph)
}

/// `lambda plan' Sigma^-1 (u - plan)`.
fn noise_cost<const NU: usize>(
    penalty: &[[f32; NU]; NU],
    plan: &[Expr; NU],
    u: &[Expr; NU],
) -> Expr {
    (0..NU).fold(Expr::lit(0.0), |cost, i| {
        let row = (0..NU).fold(Expr::lit(0.0), |row, j| row + Expr::lit(penalty[j][i]) * plan[j]);
        cost + row * (u[i] - plan[i])
    })
}

/// `charge_value`: the cost so far with the penalty on the value.
fn value_text(term: Option<&ValueTerm<'_>>) -> String {
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
fn push_text<const NX: usize>(disturbance: Option<&Disturbance<'_>>) -> String {
    let head = "fn disturb(column: u32, x: State) -> State {\n";
    let Some(disturbance) = disturbance else {
        return format!("{head}    return x;\n}}\n");
    };
    let outputs = disturbance.entries.len();
    let graph = record(NX + outputs, |inputs| {
        let mut x = inputs[..NX].to_vec();
        for ((state, scale), push) in disturbance.entries.iter().zip(&inputs[NX..]) {
            x[*state] = x[*state] + Expr::lit(*scale) * *push;
        }
        x
    });
    let arguments = [("x", "State", NX), ("d", "Push", outputs)];
    let recorded = both("pushed", "recorded_push", &arguments, ("State", NX), &graph);
    let slot = Slot::Push as u32;
    let mut text = format!(
        "alias Push = array<f32, {outputs}>;\n{recorded}\
         @group(0) @binding({slot}) var<storage, read> push: array<vec4<f32>>;\n{head}"
    );
    for quad in 0..outputs.div_ceil(4) {
        text += &format!("    let v{quad} = push[{quad}u * params.stride + column];\n");
    }
    let all: Vec<String> = (0..outputs).map(component).collect();
    text + &format!("    return pushed(x, Push({}));\n}}\n", all.join(", "))
}

/// Sizes of the update, the exponential of its weights, and `put_terms`.
fn update_text(controls: usize) -> String {
    let tile = tile_steps(controls);
    let exponential = record(1, |x| vec![x[0].exp_negative()]);
    let mut text = format!(
        "const PARTIAL_HEADER: u32 = {PARTIAL_HEADER}u;\nconst TILE_STEPS: u32 = {tile}u;\n{}\
         fn put_terms(lane: u32, step: u32, weight: f32, u: Control) {{\n",
        function("exp_negative", &[("x", 1)], &exponential)
    );
    for i in 0..controls {
        let row = format!("(step * NU + {i}u)");
        text += &format!("    terms[{row} * TERM_PITCH + lane] = weight * u[{i}];\n");
    }
    text + "}\n"
}

/// The recorded function and the one that calls it.
fn both(
    name: &str,
    recorded: &str,
    arguments: &[(&str, &str, usize)],
    result: (&str, usize),
    graph: &Graph,
) -> String {
    let inputs: Vec<(&str, usize)> =
        arguments.iter().map(|(name, _, length)| (*name, *length)).collect();
    let text = function(recorded, &inputs, graph);
    [text, call(name, recorded, arguments, result)].concat()
}
