//! The text of the kernels of measures, pairs and networks.

use super::glue::{
    FINITE, PARAMS, RNG, call, component, constants, finite_glue, recorded_pair, state_glue,
};
use super::layers::{Fused, fused_text, layer_text};
use super::{Access, Kernel, Slot};
use crate::formula::wgsl::{CHOICES, Product, function, function_with};
use crate::formula::{Expr, record};
use crate::policy::{Activation, Mlp, OutputActivation};
use crate::real::Real;

const FOLD: &str = include_str!("../../../../shaders/fold.wgsl");
const JUDGE: &str = include_str!("../../../../shaders/judge.wgsl");
const SAMPLE: &str = include_str!("../../../../shaders/sample.wgsl");
const REACH_AVOID: &str = include_str!("../../../../shaders/reach_avoid.wgsl");
const COMPACT: &str = include_str!("../../../../shaders/compact.wgsl");
const DEVIATION: &str = include_str!("../../../../shaders/deviation.wgsl");
const REDUCE: &str = include_str!("../../../../shaders/reduce.wgsl");

/// What the text of a kernel depends on besides the physics.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of states.
    pub states: usize,
    /// Number of controls.
    pub controls: usize,
    /// Activations of the network, where the policy is one.
    pub network: Option<(Activation, OutputActivation)>,
    /// Its layers, where the rollouts run them.
    pub fused: Option<Fused>,
}

impl Shape {
    /// The shape for a system of that many states and controls, driven by a formula or by a network
    /// whose layers have kernels of their own.
    pub fn new(states: usize, controls: usize, network: Option<&Mlp>) -> Self {
        let network = network.map(|mlp| (mlp.activation(), mlp.output()));
        Self { states, controls, network, fused: None }
    }

    /// What `kernel` binds.
    pub fn bindings(&self, kernel: Kernel) -> Vec<(Slot, Access)> {
        let mut list = kernel.bindings(self.network.is_some());
        if self.fused.is_some() {
            let control = list.iter_mut().filter(|(slot, _)| *slot == Slot::Control);
            control.for_each(|(slot, _)| *slot = Slot::Weights);
        }
        list
    }

    /// Threads of a workgroup of `kernel`, which has [`Kernel::workgroup`] trajectories.
    pub fn lanes(&self, kernel: Kernel) -> u32 {
        match (kernel, &self.fused) {
            (Kernel::ReachAvoid | Kernel::Deviation, Some(fused)) => fused.lanes(),
            _ => kernel.workgroup(),
        }
    }
}

/// The WGSL module of `kernel` for the physics of a plant (see [`crate::backend::physics`]); for
/// those of MPPI see [`super::MppiText`].
pub fn compose(kernel: Kernel, shape: &Shape, physics: &str) -> String {
    let states = shape.states;
    let folds = || [FINITE, FOLD].concat();
    let rollout = || {
        let lanes = format!(
            "const LANES: u32 = {}u;\n// Whether `drive` is called by all threads together.\n\
             const TOGETHER: bool = {};\n",
            shape.lanes(kernel),
            shape.fused.is_some()
        );
        let glue = [lanes, state_glue(states), finite_glue(states), plant_glue(shape)].concat();
        [folds(), glue, physics.to_owned(), JUDGE.to_owned()].join("\n")
    };
    let draw = || [state_glue(states), RNG.to_owned(), recorded_normals()].join("\n");
    let parts = match kernel {
        Kernel::Sample => vec![folds(), draw(), SAMPLE.to_owned()],
        Kernel::ReachAvoid => vec![rollout(), REACH_AVOID.to_owned()],
        Kernel::Deviation => vec![rollout(), recorded_distance(states), DEVIATION.to_owned()],
        Kernel::Compact => vec![folds(), COMPACT.to_owned()],
        Kernel::Reduce => vec![REDUCE.to_owned()],
        Kernel::HiddenLayer => vec![layer_text(shape.network, false)],
        Kernel::OutputLayer => vec![layer_text(shape.network, true)],
        Kernel::MppiStart | Kernel::MppiRollout | Kernel::MppiUpdate => {
            panic!("{kernel:?} is composed by MppiText")
        }
        Kernel::Peak | Kernel::Copy => panic!("{kernel:?} is composed by `limit_kernel`"),
    };
    let shared = vec![constants(states, shape.controls), PARAMS.to_owned(), CHOICES.to_owned()];
    [shared, parts].concat().join("\n")
}

/// Calls of the recorded functions of the plant.
fn plant_glue(shape: &Shape) -> String {
    let (x, u) = (("x", "State", shape.states), ("u", "Control", shape.controls));
    let mut text = [
        call("advance", "plant_step", &[x, u], ("State", shape.states)),
        call("target_at", "plant_target", &[x], ("f32", 1)),
        call("constraint_at", "plant_constraint", &[x], ("f32", 1)),
    ]
    .concat();
    if shape.network.is_none() {
        text += &call("control_of", "plant_control", &[x], ("Control", shape.controls));
        text += "fn drive(lane: u32, column: u32, x: State) -> Control {\n    \
                 return control_of(x);\n}\n";
        return text;
    }
    if let Some(fused) = &shape.fused {
        return text + &fused_text(shape.network, fused, [shape.states, shape.controls]);
    }
    let slot = Slot::Control as u32;
    text += &format!(
        "@group(0) @binding({slot}) var<storage, read> control: array<vec4<f32>>;\n\
         fn drive(lane: u32, column: u32, x: State) -> Control {{\n    \
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
    let logarithm = record(1, |u| vec![u[0].ln_unit()]);
    let apart = Product::Call("product");
    [function_with("ln_unit", &[("u", 1)], &logarithm, apart), recorded_pair()].join("\n")
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
