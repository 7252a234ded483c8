//! Recorded functions under the names and with the arguments that the kernels call them by.

use super::fused::Fused;
use super::kernels::Slot;
use super::layers::Kinds;
use crate::backend::physics::{Function, Part, Physics, Role};
use crate::model::share;
use crate::policy::Mlp;

/// What the texts have of a plant besides its formulas.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outline {
    /// Number of states.
    pub(super) states: usize,
    /// Number of controls.
    pub(super) controls: usize,
    /// Number of parameters.
    pub(super) parameters: usize,
    /// Seconds between two steps; 0 where the model does not say.
    pub(super) period: f32,
    /// Parts of a period; the kernels count moments in them where there are more than 1.
    pub(super) points: u32,
    /// Numbers of context that the cost of a stage takes; 0 where there is no cost.
    pub(super) contexts: usize,
    /// The network that drives, if one does.
    pub(super) driving: Option<DrivingNetwork>,
}

/// What the texts have of the network that drives.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DrivingNetwork {
    /// What comes behind the sums of its layers.
    pub(super) kinds: Kinds,
    /// Numbers that it sees.
    pub(super) inputs: usize,
    /// Numbers that it says.
    pub(super) outputs: usize,
    /// Its layers, where the rollouts run them.
    pub(super) fused: Option<Fused>,
}

impl DrivingNetwork {
    /// What the texts have of `mlp`, its layers with kernels of their own.
    pub(super) fn new(mlp: &Mlp) -> Self {
        let widths = mlp.widths();
        Self {
            kinds: Kinds::of(mlp),
            inputs: widths[0],
            outputs: widths[widths.len() - 1],
            fused: None,
        }
    }
}

impl Function {
    /// Whether it takes `part`.
    pub(super) fn reads(&self, part: Part) -> bool {
        self.takes.contains(&part)
    }
}

impl Physics {
    /// The function of `role`, if there is one.
    pub(super) fn function(&self, role: Role) -> Option<&Function> {
        self.functions.iter().find(|function| function.role == role)
    }
}

/// `functions` as recorded and what calls them: `advance`, `target_at`, `constraint_at`,
/// `control_of`, `observed`, `acted`, `staged`, `cell_at`, `cells_of`, `ended`, all of them given the number of the
/// step, or of the parts of periods so far where these have several.
pub(super) fn physics_glue(outline: &Outline, functions: &[&Function]) -> String {
    let reads = |part| functions.iter().any(|function| function.reads(part));
    let mut glue = String::new();
    if reads(Part::Parameters) {
        glue += &parameter_glue(outline.parameters);
    }
    if reads(Part::Seconds) {
        glue += &seconds_glue(outline.period, outline.points);
    }
    for function in functions {
        glue += &function.text;
        glue += &caller(outline, function);
    }
    let has = |role| functions.iter().any(|function| function.role == role);
    glue + &network_glue(outline, has)
}

/// `parameters`: the parameters of the model, from constant memory.
pub(super) fn parameter_glue(count: usize) -> String {
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

/// `seconds_at`: the time at a step, or after so many parts of periods that have `points` each.
pub(super) fn seconds_glue(period: f32, points: u32) -> String {
    if points == 1 {
        return format!("fn seconds_at(t: u32) -> f32 {{\n    return f32(t) * {period:?}f;\n}}\n");
    }
    // Numbers of the host: a quotient of a device may be another one.
    let shares: Vec<String> =
        (0..points).map(|point| format!("{:?}f", share(point, points))).collect();
    format!(
        "fn seconds_at(t: u32) -> f32 {{\n    \
         var shares = array<f32, POINTS>({});\n    \
         return (f32(t / POINTS) + shares[t % POINTS]) * {period:?}f;\n}}\n",
        shares.join(", ")
    )
}

/// What the places of a formula on maps are.
const CELLS: &str = "array<f32, LOOKUPS>";
/// What the kernels give every formula.
pub(super) const STATE: &str = "x: array<f32, NX>";
/// What they give those of steps and stages besides.
pub(super) const CONTROL: &str = "u: array<f32, NU>";

/// `arguments` of a cost, with the context where there is one.
pub(super) fn told<'a>(outline: &Outline, arguments: &[&'a str]) -> Vec<&'a str> {
    let context = (outline.contexts > 0).then_some("context: array<f32, CONTEXTS>");
    arguments.iter().copied().chain(context).collect()
}

/// The names of arguments.
pub(super) fn names_of(arguments: &[&str]) -> String {
    let names = arguments.iter().map(|argument| argument.split(':').next().unwrap_or_default());
    names.collect::<Vec<_>>().join(", ")
}

/// The function by which the kernels call `function`.
fn caller(outline: &Outline, function: &Function) -> String {
    let (name, arguments, kind, several) = match function.role {
        Role::Step => ("advance", vec![STATE, CONTROL], "array<f32, NX>", true),
        Role::Target => ("target_at", vec![STATE], "f32", false),
        Role::Constraint => ("constraint_at", vec![STATE], "f32", false),
        Role::Control => ("control_of", vec![STATE], "array<f32, NU>", true),
        Role::Observe => ("observed", vec![STATE], "array<f32, SEEN>", true),
        Role::Act => ("acted", vec![STATE, "said: array<f32, SAID>"], "array<f32, NU>", true),
        Role::Stage => ("staged", told(outline, &[STATE, CONTROL]), "f32", false),
        Role::StagePlaces => ("cells_of", told(outline, &[STATE, CONTROL]), CELLS, true),
        Role::Cell => ("cell_at", vec![STATE], "f32", false),
        Role::Terminal => ("ended", told(outline, &[STATE]), "f32", false),
        Role::TerminalPlaces => ("cells_of", told(outline, &[STATE]), CELLS, true),
    };
    let said = outline.driving.as_ref().map_or(0, |driving| driving.outputs);
    // A single number is an f32 to the recorded function, and an array to the kernel.
    let array = |name: &str, length: usize| match length {
        1 => format!("{name}[0]"),
        _ => name.to_owned(),
    };
    let passed = |part: &Part| match part {
        Part::State => array("x", outline.states),
        Part::Control => array("u", outline.controls),
        Part::Said => array("said", said),
        Part::Context => array("context", outline.contexts),
        Part::Looked => format!("looked_up({}, t)", names_of(&arguments)),
        Part::Parameters => "parameters()".to_owned(),
        Part::Seconds => "seconds_at(t)".to_owned(),
        Part::Step if outline.points > 1 => "f32(t / POINTS)".to_owned(),
        Part::Step => "f32(t)".to_owned(),
    };
    let passed: Vec<String> = function.takes.iter().map(passed).collect();
    let call = format!("{}({})", function.role.name(), passed.join(", "));
    let value = if several && function.outputs == 1 { format!("{kind}({call})") } else { call };
    let arguments = arguments.join(", ");
    format!("fn {name}({arguments}, t: u32) -> {kind} {{\n    return {value};\n}}\n")
}

/// What stands around the network where nothing is said: it sees the states, and says the controls.
fn network_glue(outline: &Outline, has: impl Fn(Role) -> bool) -> String {
    let Some(driving) = &outline.driving else { return String::new() };
    let mut glue = format!(
        "const SEEN: u32 = {}u;\nconst SAID: u32 = {}u;\n",
        driving.inputs, driving.outputs
    );
    let rolls = has(Role::Step);
    if rolls && driving.fused.is_some() && !has(Role::Observe) {
        glue += "fn observed(x: array<f32, NX>, t: u32) -> array<f32, SEEN> {\n    return x;\n}\n";
    }
    if rolls && !has(Role::Act) {
        glue += "fn acted(x: array<f32, NX>, said: array<f32, SAID>, t: u32) -> array<f32, NU> {\n    \
                 return said;\n}\n";
    }
    glue
}
