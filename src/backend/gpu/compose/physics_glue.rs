//! Recorded functions under the names and with the arguments that the kernels call them by.

use super::Slot;
use super::plant::PlantText;
use crate::backend::physics::{Function, Part, Role};

/// The functions of `roles` as recorded and what calls them: `advance`, `target_at`,
/// `constraint_at`, `control_of`, `observed`, `acted`, all of them given the number of the step.
pub(super) fn physics_glue(text: &PlantText, roles: &[Role]) -> String {
    let functions: Vec<&Function> =
        roles.iter().filter_map(|role| text.physics.function(*role)).collect();
    let reads = |part| functions.iter().any(|function| function.reads(part));
    let mut glue = String::new();
    if reads(Part::Parameters) {
        glue += &parameter_glue(text.parameters);
    }
    if reads(Part::Seconds) {
        glue += &seconds_glue(text.period);
    }
    for function in &functions {
        glue += &function.text;
        glue += &caller(text, function);
    }
    glue + &network_glue(text, roles)
}

/// `parameters`: the parameters of the model, from constant memory.
fn parameter_glue(count: usize) -> String {
    let quads = count.div_ceil(4);
    let all: Vec<String> =
        (0..count).map(|i| format!("values[{}].{}", i / 4, ["x", "y", "z", "w"][i % 4])).collect();
    let (kind, value) = match all.as_slice() {
        [single] => ("f32".to_owned(), single.clone()),
        _ => (format!("array<f32, {count}>"), format!("array<f32, {count}>({})", all.join(", "))),
    };
    format!(
        "@group(0) @binding({}) var<uniform> values: array<vec4<f32>, {quads}>;\n\
         fn parameters() -> {kind} {{\n    return {value};\n}}\n",
        Slot::Values as u32
    )
}

/// `seconds_at`: the time at a step.
fn seconds_glue(period: f32) -> String {
    format!("fn seconds_at(t: u32) -> f32 {{\n    return f32(t) * {period:?}f;\n}}\n")
}

/// The function by which the kernels call `function`.
fn caller(text: &PlantText, function: &Function) -> String {
    let (name, arguments, kind, several) = match function.role {
        Role::Step => ("advance", "x: State, u: Control", "State", true),
        Role::Target => ("target_at", "x: State", "f32", false),
        Role::Constraint => ("constraint_at", "x: State", "f32", false),
        Role::Control => ("control_of", "x: State", "Control", true),
        Role::Observe => ("observed", "x: State", "Inputs", true),
        Role::Act => ("acted", "x: State, said: Outputs", "Control", true),
    };
    let said = text.driver.as_ref().map_or(0, |driver| driver.outputs);
    // A single number is an f32 to the recorded function, and an array to the kernel.
    let array = |name: &str, length: usize| match length {
        1 => format!("{name}[0]"),
        _ => name.to_owned(),
    };
    let passed = |part: &Part| match part {
        Part::State => array("x", text.states),
        Part::Control => array("u", text.controls),
        Part::Said => array("said", said),
        Part::Parameters => "parameters()".to_owned(),
        Part::Seconds => "seconds_at(t)".to_owned(),
        Part::Step => "f32(t)".to_owned(),
    };
    let passed: Vec<String> = function.takes.iter().map(passed).collect();
    let call = format!("{}({})", function.role.name(), passed.join(", "));
    let value = if several && function.outputs == 1 { format!("{kind}({call})") } else { call };
    format!("fn {name}({arguments}, t: u32) -> {kind} {{\n    return {value};\n}}\n")
}

/// What stands around the network where nothing is said: it sees the states, and says the controls.
fn network_glue(text: &PlantText, roles: &[Role]) -> String {
    let Some(driver) = &text.driver else { return String::new() };
    let mut glue = format!(
        "alias Inputs = array<f32, {}>;\nalias Outputs = array<f32, {}>;\n",
        driver.inputs, driver.outputs
    );
    let rolls = roles.contains(&Role::Step);
    if rolls && driver.fused.is_some() && !roles.contains(&Role::Observe) {
        glue += "fn observed(x: State, t: u32) -> Inputs {\n    return x;\n}\n";
    }
    if rolls && !roles.contains(&Role::Act) {
        glue += "fn acted(x: State, said: Outputs, t: u32) -> Control {\n    return said;\n}\n";
    }
    glue
}
