//! The text of each kernel: constants, recorded formulas and the files of `shaders/`, concatenated.

use crate::policy::{Activation, Mlp, OutputActivation};
use crate::real::Real;
use crate::real::record::{Expr, Graph, record};
use crate::real::wgsl::{Product, function, function_with};
use crate::rollout::{HUGE, NON_FINITE, normal_pair};

/// Threads of a workgroup, one trajectory or pair each.
pub const WORKGROUP: u32 = 64;
/// Threads of a workgroup of the network's layers.
pub const MLP_LANES: u32 = 32;
/// Trajectories that one thread of a layer computes.
pub const TILE_COLUMNS: u32 = 8;
/// Vectors of 4 neurons that one thread of a layer computes.
pub const TILE_QUADS: u32 = 2;

const PARAMS: &str = include_str!("../../../shaders/params.wgsl");
const RNG: &str = include_str!("../../../shaders/rng.wgsl");
const FOLD: &str = include_str!("../../../shaders/fold.wgsl");
const JUDGE: &str = include_str!("../../../shaders/judge.wgsl");
const SAMPLE: &str = include_str!("../../../shaders/sample.wgsl");
const REACH_AVOID: &str = include_str!("../../../shaders/reach_avoid.wgsl");
const COMPACT: &str = include_str!("../../../shaders/compact.wgsl");
const DEVIATION: &str = include_str!("../../../shaders/deviation.wgsl");
const REDUCE: &str = include_str!("../../../shaders/reduce.wgsl");
const MLP: &str = include_str!("../../../shaders/mlp.wgsl");

/// The kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Draws starts or pairs.
    Sample,
    /// Rolls trajectories and folds their margins.
    ReachAvoid,
    /// Keeps the trajectories whose sign is open.
    Compact,
    /// Rolls pairs side by side.
    Deviation,
    /// Finds the farthest pair of each step.
    Reduce,
    /// A hidden layer of the network.
    HiddenLayer,
    /// The last layer of the network.
    OutputLayer,
}

/// How a kernel uses a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The uniform block of parameters, at a dynamic offset.
    Uniform,
    /// Storage that is read.
    Read,
    /// Storage that is read and written.
    ReadWrite,
}

/// Buffers by the number that they are bound to; the shaders declare them under the same names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Slot {
    /// `params`.
    Params = 0,
    /// `region`: one vector per coordinate.
    Region = 1,
    /// `schedule`: one vector per step.
    Schedule = 2,
    /// `state`: vectors of 4 states, `[NX / 4, sides, stride]`.
    State = 3,
    /// `folds`: `[sides, stride]`.
    Folds = 4,
    /// `origin`: place of each column in the chunk.
    Origin = 5,
    /// `control`: vectors of 4 controls of the network.
    Control = 6,
    /// `measures` or `pair_measures`, by place in the chunk.
    Measures = 7,
    /// `distances`: `[steps, stride]`.
    Distances = 8,
    /// `farthest`: `[T + 1]`.
    Farthest = 9,
    /// `kept_state`.
    KeptState = 10,
    /// `kept_folds`.
    KeptFolds = 11,
    /// `kept_origin`.
    KeptOrigin = 12,
    /// `survivors`: one number.
    Survivors = 13,
    /// `weights`: the network's parameters.
    Weights = 14,
    /// `source`: the input of a layer.
    Source = 15,
    /// `sink`: its output.
    Sink = 16,
}

/// What the text of a kernel depends on besides the physics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of states.
    pub states: usize,
    /// Number of controls.
    pub controls: usize,
    /// Activations of the network, where the policy is one.
    pub network: Option<(Activation, OutputActivation)>,
}

impl Shape {
    /// The shape for a system of that many states and controls, driven by a network or a formula.
    pub fn new(states: usize, controls: usize, network: Option<&Mlp>) -> Self {
        Self { states, controls, network: network.map(|mlp| (mlp.activation(), mlp.output())) }
    }
}

impl Kernel {
    /// Every kernel.
    pub const ALL: [Self; 7] = [
        Self::Sample,
        Self::ReachAvoid,
        Self::Compact,
        Self::Deviation,
        Self::Reduce,
        Self::HiddenLayer,
        Self::OutputLayer,
    ];

    /// Name of the entry point.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::ReachAvoid => "reach_avoid",
            Self::Compact => "compact",
            Self::Deviation => "deviation",
            Self::Reduce => "reduce",
            Self::HiddenLayer | Self::OutputLayer => "mlp",
        }
    }

    /// Threads of a workgroup.
    pub fn workgroup(self) -> u32 {
        match self {
            Self::HiddenLayer | Self::OutputLayer => MLP_LANES,
            _ => WORKGROUP,
        }
    }

    /// What the kernel binds, for a plant driven by a network or by a formula.
    pub fn bindings(self, network: bool) -> Vec<(Slot, Access)> {
        use Access::{Read, ReadWrite, Uniform};
        use Slot as S;
        let mut list = vec![(S::Params, Uniform)];
        let more: &[(Slot, Access)] = match self {
            Self::Sample => &[
                (S::Region, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Origin, ReadWrite),
            ],
            Self::ReachAvoid => &[
                (S::Schedule, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Origin, Read),
                (S::Measures, ReadWrite),
            ],
            Self::Compact => &[
                (S::State, Read),
                (S::Folds, Read),
                (S::Origin, Read),
                (S::KeptState, ReadWrite),
                (S::KeptFolds, ReadWrite),
                (S::KeptOrigin, ReadWrite),
                (S::Survivors, ReadWrite),
            ],
            Self::Deviation => &[
                (S::Schedule, Read),
                (S::State, ReadWrite),
                (S::Folds, ReadWrite),
                (S::Measures, ReadWrite),
                (S::Distances, ReadWrite),
            ],
            Self::Reduce => &[(S::Distances, Read), (S::Farthest, ReadWrite)],
            Self::HiddenLayer | Self::OutputLayer => {
                &[(S::Weights, Read), (S::Source, Read), (S::Sink, ReadWrite)]
            }
        };
        list.extend_from_slice(more);
        if network && matches!(self, Self::ReachAvoid | Self::Deviation) {
            list.push((S::Control, Read));
        }
        list
    }
}

/// The WGSL module of `kernel` for the physics of a plant (see [`crate::backend::physics`]).
pub fn compose(kernel: Kernel, shape: &Shape, physics: &str) -> String {
    let constants = constants(shape);
    let rollout = || [state_glue(shape), plant_glue(shape), physics.to_owned()].join("\n");
    let parts = match kernel {
        Kernel::Sample => vec![
            FOLD.to_owned(),
            state_glue(shape),
            RNG.to_owned(),
            recorded_normals(),
            SAMPLE.to_owned(),
        ],
        Kernel::ReachAvoid => vec![FOLD.into(), rollout(), JUDGE.into(), REACH_AVOID.into()],
        Kernel::Deviation => vec![
            FOLD.to_owned(),
            rollout(),
            recorded_distance(shape.states),
            JUDGE.to_owned(),
            DEVIATION.to_owned(),
        ],
        Kernel::Compact => vec![FOLD.to_owned(), COMPACT.to_owned()],
        Kernel::Reduce => vec![REDUCE.to_owned()],
        Kernel::HiddenLayer | Kernel::OutputLayer => {
            vec![recorded_activation(kernel, shape), MLP.to_owned()]
        }
    };
    [vec![constants, PARAMS.to_owned()], parts].concat().join("\n")
}

/// Sizes and sentinels that the kernels share with Rust.
fn constants(shape: &Shape) -> String {
    format!(
        "const NX: u32 = {}u;\n\
         const STATE_QUADS: u32 = {}u;\n\
         const WORKGROUP: u32 = {WORKGROUP}u;\n\
         const MLP_LANES: u32 = {MLP_LANES}u;\n\
         const HUGE: f32 = {HUGE:?}f;\n\
         const NON_FINITE: f32 = {NON_FINITE:?}f;\n\
         alias State = array<f32, {}>;\n\
         alias Control = array<f32, {}>;\n",
        shape.states,
        shape.states.div_ceil(4),
        shape.states,
        shape.controls,
    )
}

/// `load_state`, `store_state` and `state_finite`, free of loops.
fn state_glue(shape: &Shape) -> String {
    let stride = "params.stride * (1u + params.paired)";
    let quads = shape.states.div_ceil(4);
    let mut text = String::from("fn load_state(column: u32) -> State {\n");
    text += &format!("    let stride = {stride};\n");
    for quad in 0..quads {
        text += &format!("    let v{quad} = state[{quad}u * stride + column];\n");
    }
    let all: Vec<String> = (0..shape.states).map(component).collect();
    text += &format!("    return State({});\n}}\n", all.join(", "));

    text += "fn store_state(column: u32, x: State) {\n";
    text += &format!("    let stride = {stride};\n");
    for quad in 0..quads {
        let entry = |i: usize| {
            if i < shape.states { format!("x[{i}]") } else { "0.0".to_owned() }
        };
        let entries: Vec<String> = (4 * quad..4 * quad + 4).map(entry).collect();
        let entries = entries.join(", ");
        text += &format!("    state[{quad}u * stride + column] = vec4<f32>({entries});\n");
    }
    text += "}\n";

    let tests: Vec<String> = (0..shape.states).map(|i| format!("finite(x[{i}])")).collect();
    text += "fn state_finite(x: State) -> bool {\n";
    text += &format!("    return {};\n}}\n", tests.join(" && "));
    text
}

/// Entry `i` of vectors `v0`, `v1`, ...
fn component(i: usize) -> String {
    format!("v{}.{}", i / 4, ["x", "y", "z", "w"][i % 4])
}

/// Calls of the recorded functions, whose single states and controls are plain numbers.
fn plant_glue(shape: &Shape) -> String {
    let argument = |name: &str, length: usize| {
        if length == 1 { format!("{name}[0]") } else { name.to_owned() }
    };
    let result = |kind: &str, length: usize, call: String| {
        if length == 1 { format!("{kind}({call})") } else { call }
    };
    let x = argument("x", shape.states);
    let u = argument("u", shape.controls);
    let step = result("State", shape.states, format!("plant_step({x}, {u})"));
    let mut text = format!(
        "fn advance(x: State, u: Control) -> State {{\n    return {step};\n}}\n\
         fn target_at(x: State) -> f32 {{\n    return plant_target({x});\n}}\n\
         fn constraint_at(x: State) -> f32 {{\n    return plant_constraint({x});\n}}\n"
    );
    if shape.network.is_none() {
        let control = result("Control", shape.controls, format!("plant_control({x})"));
        text += "fn drive(column: u32, x: State) -> Control {\n";
        text += &format!("    return {control};\n}}\n");
        return text;
    }
    let slot = Slot::Control as u32;
    text += &format!(
        "@group(0) @binding({slot}) var<storage, read> control: array<vec4<f32>>;\n\
         fn drive(column: u32, x: State) -> Control {{\n    \
         let stride = params.stride * (1u + params.paired);\n"
    );
    for quad in 0..shape.controls.div_ceil(4) {
        text += &format!("    let v{quad} = control[{quad}u * stride + column];\n");
    }
    let all: Vec<String> = (0..shape.controls).map(component).collect();
    text += &format!("    return Control({});\n}}\n", all.join(", "));
    text
}

/// `normal_pair` and `ln_unit`, their products kept apart from sums.
fn recorded_normals() -> String {
    let apart = Product::Call("product");
    let logarithm = record(1, |u| vec![u[0].ln_unit()]);
    let pair = record(2, |u| normal_pair(u[0], u[1]).to_vec());
    let arguments = [("magnitude", 1), ("turn", 1)];
    [
        function_with("ln_unit", &[("u", 1)], &logarithm, apart),
        function_with("normal_pair", &arguments, &pair, apart),
    ]
    .join("\n")
}

/// `state_distance`, the Euclidean distance of two states.
fn recorded_distance(states: usize) -> String {
    let graph = record(2 * states, |both| {
        let (nominal, perturbed) = both.split_at(states);
        let square = nominal.iter().zip(perturbed).fold(Expr::lit(0.0), |sum, (&a, &b)| {
            let gap = b - a;
            sum + gap * gap
        });
        vec![square.sqrt()]
    });
    let recorded = function("distance_of", &[("a", states), ("b", states)], &graph);
    let call = if states == 1 { "a[0], b[0]" } else { "a, b" };
    format!(
        "{recorded}\nfn state_distance(a: State, b: State) -> f32 {{\n    \
         return distance_of({call});\n}}\n"
    )
}

/// `activation` of a layer; the identity where there is no network.
fn recorded_activation(kernel: Kernel, shape: &Shape) -> String {
    let graph: Graph = record(1, |x| {
        vec![match (kernel, shape.network) {
            (Kernel::HiddenLayer, Some((hidden, _))) => hidden.apply(x[0]),
            (_, Some((_, output))) => output.apply(x[0]),
            (_, None) => x[0],
        }]
    });
    function("activation", &[("x", 1)], &graph)
}
