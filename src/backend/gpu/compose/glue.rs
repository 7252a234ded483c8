//! Text that the kernels share: sizes, access to states and tables, calls of recorded functions.

use std::ops::Range;

use super::kernels::{Slot, WORKGROUP};
use crate::formula::record;
use crate::formula::wgsl::{Arithmetic, function_with};
use crate::rollout::{HUGE, NON_FINITE, normal_pair};

pub(super) const PARAMS: &str = include_str!("../../../../shaders/params.wgsl");
pub(super) const FINITE: &str = include_str!("../../../../shaders/finite.wgsl");
pub(super) const RNG: &str = include_str!("../../../../shaders/rng.wgsl");

/// Sizes and sentinels that the kernels share with Rust.
pub(super) fn constants(states: usize, controls: usize) -> String {
    constants_with(states, controls, states)
}

/// The same where a kernel's state is `length` numbers, those that are stored first. Arrays have no
/// names of their own: two types of one shape are one to WGSL, and may be two to a driver.
pub(super) fn constants_with(states: usize, controls: usize, length: usize) -> String {
    format!(
        "const NX: u32 = {}u;\n\
         const NU: u32 = {}u;\n\
         const STATE_QUADS: u32 = {}u;\n\
         const WORKGROUP: u32 = {WORKGROUP}u;\n\
         const HUGE: f32 = {HUGE:?}f;\n\
         const NON_FINITE: f32 = {NON_FINITE:?}f;\n",
        length,
        controls,
        states.div_ceil(4),
    )
}

/// Trajectories in each row of the state.
const ROW: &str = "params.stride * (1u + params.paired)";

/// `load_state` and `store_state`, free of loops.
pub(super) fn state_glue(states: usize) -> String {
    load_glue(states, &[]) + &store_glue(states)
}

/// `store_state` alone.
pub(super) fn store_glue(states: usize) -> String {
    let mut text = String::from("fn store_state(column: u32, x: array<f32, NX>) {\n");
    text += &format!("    let stride = {ROW};\n");
    for quad in 0..states.div_ceil(4) {
        let entries = padded("x", quad, states);
        text += &format!("    state[{quad}u * stride + column] = {entries};\n");
    }
    text + "}\n"
}

/// `load_state` alone, for kernels that may not write states; `more` numbers follow those of the state.
pub(super) fn load_glue(states: usize, more: &[String]) -> String {
    let mut text = String::from("fn load_state(column: u32) -> array<f32, NX> {\n");
    text += &format!("    let stride = {ROW};\n");
    for quad in 0..states.div_ceil(4) {
        text += &format!("    let v{quad} = state[{quad}u * stride + column];\n");
    }
    let all: Vec<String> = (0..states).map(component).chain(more.iter().cloned()).collect();
    text + &format!("    return array<f32, NX>({});\n}}\n", all.join(", "))
}

/// `listed_start`: a start that the host lists, `[NX / 4, columns]` vectors of 4 coordinates.
pub(super) fn listed_glue(states: usize) -> String {
    let mut text = String::from("fn listed_start(column: u32) -> array<f32, NX> {\n");
    for quad in 0..states.div_ceil(4) {
        text += &format!("    let v{quad} = region[{quad}u * params.columns + column];\n");
    }
    let all: Vec<String> = (0..states).map(component).collect();
    text + &format!("    return array<f32, NX>({});\n}}\n", all.join(", "))
}

/// The vector number `quad` of the `length` numbers of `name`, padded with 0.
pub(super) fn padded(name: &str, quad: usize, length: usize) -> String {
    let entry = |i: usize| if i < length { format!("{name}[{i}]") } else { "0.0".to_owned() };
    let entries: Vec<String> = (4 * quad..4 * quad + 4).map(entry).collect();
    format!("vec4<f32>({})", entries.join(", "))
}

/// `state_finite`, free of loops.
pub(super) fn finite_glue(states: usize) -> String {
    let tests: Vec<String> = (0..states).map(|i| format!("finite(x[{i}])")).collect();
    let all = tests.join(" && ");
    format!("fn state_finite(x: array<f32, NX>) -> bool {{\n    return {all};\n}}\n")
}

/// Entry `i` of vectors `v0`, `v1`, ...
pub(super) fn component(i: usize) -> String {
    format!("v{}.{}", i / 4, ["x", "y", "z", "w"][i % 4])
}

/// An argument of a function: name, type, length; an `f32` is a plain number.
pub(super) type Argument<'a> = (&'a str, &'a str, usize);

/// The function `name` that calls the recorded function `recorded`, whose single states, controls
/// and the like are plain numbers; this one returns the `length` numbers of that as a `kind`.
pub(super) fn call(
    name: &str,
    recorded: &str,
    arguments: &[Argument<'_>],
    kind: &str,
    length: usize,
) -> String {
    let declared: Vec<String> =
        arguments.iter().map(|(name, kind, _)| format!("{name}: {kind}")).collect();
    let passed = |(name, kind, length): &Argument<'_>| match (*kind, length) {
        ("f32", _) | (_, 2..) => (*name).to_owned(),
        _ => format!("{name}[0]"),
    };
    let passed: Vec<String> = arguments.iter().map(passed).collect();
    let call = format!("{recorded}({})", passed.join(", "));
    let value = if length == 1 && kind != "f32" { format!("{kind}({call})") } else { call };
    format!("fn {name}({}) -> {kind} {{\n    return {value};\n}}\n", declared.join(", "))
}

/// `normal_pair`, with arithmetic as `arithmetic` says.
pub(super) fn recorded_pair(arithmetic: Arithmetic) -> String {
    let pair = record(2, |u| normal_pair(u[0], u[1]).to_vec());
    let arguments = [("magnitude", 1), ("turn", 1)];
    function_with("normal_pair", &arguments, &pair, arithmetic)
}

/// A function that loads the numbers `part` of row `row` of a table of rows of `length` numbers.
pub(super) fn loader(
    name: &str,
    kind: &str,
    table: &str,
    length: usize,
    part: Range<usize>,
) -> String {
    let all: Vec<String> = part.map(|i| format!("{table}[at + {i}u]")).collect();
    format!(
        "fn {name}(row: u32) -> {kind} {{\n    let at = row * {length}u;\n    \
         return {kind}({});\n}}\n",
        all.join(", ")
    )
}

/// A table of numbers that kernels read.
pub(super) fn storage(slot: Slot, name: &str) -> String {
    format!("@group(0) @binding({}) var<storage, read> {name}: array<f32>;\n", slot as u32)
}
