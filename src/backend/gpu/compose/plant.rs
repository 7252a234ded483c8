//! The text of the kernels of measures, pairs and networks.

use super::chain::ChainText;
use super::fit::{check_formulas, check_points, check_reads};
use super::fused::{Fused, fused_text};
use super::glue::{FINITE, PARAMS, RNG, component, constants, constants_with, finite_glue};
use super::glue::{listed_glue, load_glue, recorded_pair, state_glue, store_glue};
use super::kernels::{Access, COUNTED, Kernel, Slot};
use super::layers::layer_text;
use super::narrowed::block_constants;
use super::physics_glue::{DrivingNetwork, Outline, physics_glue};
use crate::backend::physics::{Function, Part, Physics, Role};
use crate::error::Result;
use crate::formula::wgsl::{Arithmetic, CHOICES, function, function_with};
use crate::formula::{Expr, record};
use crate::model::{Controller, Model};
use crate::policy::Mlp;
use crate::real::Real;

const FOLD: &str = include_str!("../../../../shaders/fold.wgsl");
const JUDGE: &str = include_str!("../../../../shaders/judge.wgsl");
const EXACT: &str = include_str!("../../../../shaders/exact.wgsl");
const SAMPLE: &str = include_str!("../../../../shaders/sample.wgsl");
const REACH_AVOID: &str = include_str!("../../../../shaders/reach_avoid.wgsl");
const REACH_AVOID_POINTS: &str = include_str!("../../../../shaders/reach_avoid_points.wgsl");
const DEVIATION_POINTS: &str = include_str!("../../../../shaders/deviation_points.wgsl");
const COMPACT: &str = include_str!("../../../../shaders/compact.wgsl");
const NARROW: &str = include_str!("../../../../shaders/narrow.wgsl");
const DEVIATION: &str = include_str!("../../../../shaders/deviation.wgsl");
const REDUCE: &str = include_str!("../../../../shaders/reduce.wgsl");
const COUNT: &str = include_str!("../../../../shaders/count.wgsl");
const COUNT_PAIRS: &str = include_str!("../../../../shaders/count_pairs.wgsl");
const OBSERVE: &str = include_str!("../../../../shaders/observe.wgsl");

/// `begin_drive` where a thread keeps nothing for its steps.
const NOTHING_TO_BEGIN: &str = "fn begin_drive(lane: u32) {\n}\n";

/// The texts of the kernels of a model and who drives it; values of parameters and weights are no
/// part of them.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantText {
    outline: Outline,
    physics: Physics,
    /// Where formulas call networks.
    chain: Option<ChainText>,
}

impl PlantText {
    /// Prints the formulas of `model` and `controller`, whose network, if any, runs in layers.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if a formula has not as many inputs or outputs as its place asks for, reads
    /// what is not known there, or the network does not fit; [`crate::Error::Invalid`] for points inside a period
    /// where formulas call networks; [`crate::Error::Device`] if more networks follow
    /// one another inside formulas than an adapter takes.
    pub fn new(model: &Model, controller: &Controller) -> Result<Self> {
        check_formulas(model, controller)?;
        let physics = Physics::new(model, controller);
        check_reads(&physics)?;
        let mut outline = Outline {
            states: model.states.len(),
            controls: model.controls.len(),
            parameters: model.parameters.len(),
            period: model.period.unwrap_or(0.0),
            points: model.points,
            contexts: 0,
            driving: controller.network().map(DrivingNetwork::new),
        };
        let chain = ChainText::new(&outline, model, controller)?;
        if chain.is_some() {
            check_points(model)?;
            // The network that drives is one of those that the chain calls.
            outline.driving = None;
        }
        Ok(Self { outline, physics, chain })
    }

    /// The same texts where the rollouts run the layers of a network themselves.
    #[must_use]
    pub fn fusing(mut self, fused: Option<Fused>) -> Self {
        if let Some(driving) = &mut self.outline.driving {
            driving.fused = fused;
        }
        self
    }

    /// The parts between networks, where formulas call some.
    pub fn chain(&self) -> Option<&ChainText> {
        self.chain.as_ref()
    }

    /// Parts of a period.
    pub fn points(&self) -> u32 {
        self.outline.points
    }

    /// Rows of the schedule for each step, and of distances: of its sample and, where there are any, of the points
    /// behind it.
    pub fn rows(&self) -> u32 {
        self.outline.points.min(2)
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        self.outline.states
    }

    /// Number of parameters of the model.
    pub fn parameters(&self) -> usize {
        self.outline.parameters
    }

    /// Whether a kernel of its own evaluates what the network sees.
    pub fn observes(&self) -> bool {
        let layered = self.outline.driving.as_ref().is_some_and(|driving| driving.fused.is_none());
        layered && self.physics.function(Role::Observe).is_some()
    }

    /// The layers that the rollouts run themselves.
    pub fn fused(&self) -> Option<&Fused> {
        self.outline.driving.as_ref().and_then(|driving| driving.fused.as_ref())
    }

    /// Operations of the formulas for one step: a line of the text is one, in each part of a period.
    pub fn operations(&self) -> u64 {
        let lines = self.physics.functions.iter().map(|one| one.text.lines().count() as u64);
        lines.sum::<u64>() * u64::from(self.outline.points)
    }

    /// What `kernel` binds.
    pub fn bindings(&self, kernel: Kernel) -> Vec<(Slot, Access)> {
        let mut list = kernel.bindings(self.outline.driving.is_some());
        match (&self.chain, kernel) {
            (Some(chain), Kernel::Link(number)) => return chain.bindings(&self.outline, number),
            (Some(_), Kernel::ReachAvoid | Kernel::Deviation) => {
                list.push((Slot::Kept, Access::Read));
            }
            _ => {}
        }
        if self.fused().is_some() {
            let control = list.iter_mut().filter(|(slot, _)| *slot == Slot::Control);
            control.for_each(|(slot, _)| *slot = Slot::Weights);
        }
        if self.roles(kernel).iter().any(|role| self.reads(*role, Part::Parameters)) {
            list.push((Slot::Values, Access::Constant));
        }
        list
    }

    /// Trajectories of a workgroup of `kernel`.
    pub fn columns(&self, kernel: Kernel) -> u32 {
        match (kernel, self.fused()) {
            (Kernel::ReachAvoid | Kernel::Deviation, Some(fused)) => fused.trajectories(),
            _ => kernel.workgroup(),
        }
    }

    /// Threads of a workgroup of `kernel`, which has [`PlantText::columns`] trajectories.
    pub fn lanes(&self, kernel: Kernel) -> u32 {
        match (kernel, self.fused()) {
            (Kernel::ReachAvoid | Kernel::Deviation, Some(fused)) => fused.lanes(),
            _ => kernel.workgroup(),
        }
    }

    /// The WGSL module of `kernel`, one of [`Kernel::ROLLOUT`], or of a link of [`PlantText::chain`]; for those of MPPI see
    /// [`super::MppiText`].
    ///
    /// # Panics
    /// For any other kernel.
    pub fn compose(&self, kernel: Kernel) -> String {
        let states = self.outline.states;
        match kernel {
            Kernel::Narrow => return block_constants() + NARROW,
            Kernel::Count | Kernel::CountPairs => return self.count(kernel),
            _ => {}
        }
        let folds = || [FINITE, FOLD].concat();
        let parts = match kernel {
            Kernel::Sample => vec![folds(), self.draw(), SAMPLE.to_owned()],
            Kernel::ReachAvoid => {
                let text = if self.looks_between() { REACH_AVOID_POINTS } else { REACH_AVOID };
                vec![self.rollout(kernel), text.to_owned()]
            }
            Kernel::Deviation => {
                let text = if self.looks_between() { DEVIATION_POINTS } else { DEVIATION };
                vec![self.rollout(kernel), self.distance(), text.to_owned()]
            }
            Kernel::Compact => vec![folds(), COMPACT.to_owned()],
            Kernel::Reduce => vec![REDUCE.to_owned()],
            Kernel::Layer(_) | Kernel::Sums | Kernel::Norm(_) => {
                let kinds = self.outline.driving.as_ref().map(|driving| driving.kinds.clone());
                vec![layer_text(&kinds.unwrap_or_default(), kernel)]
            }
            Kernel::Observe => vec![self.observation(), OBSERVE.to_owned()],
            Kernel::Link(number) if self.chain.is_some() => {
                self.chain.iter().map(|chain| chain.link(&self.outline, number)).collect()
            }
            other => panic!("{other:?} is no kernel of a plant"),
        };
        let length = match (kernel, &self.chain) {
            (Kernel::ReachAvoid | Kernel::Deviation, Some(_)) => {
                ChainText::state_length(&self.outline)
            }
            _ => states,
        };
        let sizes = constants_with(states, self.outline.controls, length);
        let shared = vec![sizes, PARAMS.to_owned(), CHOICES.to_owned()];
        [shared, parts].concat().join("\n")
    }

    /// Whether rollouts are looked at between samples.
    fn looks_between(&self) -> bool {
        self.outline.points > 1
    }

    /// What counts: bits alone, nothing of the plant.
    fn count(&self, kernel: Kernel) -> String {
        let sizes = constants(self.outline.states, self.outline.controls);
        let counted = format!("const COUNTED: u32 = {COUNTED}u;\n");
        let text = if kernel == Kernel::Count { COUNT } else { COUNT_PAIRS };
        [sizes.as_str(), PARAMS, counted.as_str(), text].join("\n")
    }

    /// What draws starts and pairs.
    fn draw(&self) -> String {
        let glue = [state_glue(self.outline.states), listed_glue(self.outline.states)].concat();
        [glue, RNG.to_owned(), EXACT.to_owned(), recorded_normals()].join("\n")
    }

    /// What judges and drives a rollout.
    fn rollout(&self, kernel: Kernel) -> String {
        let lanes = format!(
            "const LANES: u32 = {}u;\nconst COLUMNS: u32 = {}u;\n\
             // Whether `drive` is called by all threads together.\nconst TOGETHER: bool = {};\n",
            self.lanes(kernel),
            self.columns(kernel),
            self.fused().is_some()
        );
        let parts = match self.looks_between() {
            true => format!("const POINTS: u32 = {}u;\n", self.outline.points),
            false => String::new(),
        };
        let lanes = lanes + &parts;
        let states = self.outline.states;
        let moves = match &self.chain {
            Some(_) => {
                let glue = ChainText::rollout_glue(&self.outline);
                [&store_glue(states), &glue, NOTHING_TO_BEGIN].concat()
            }
            None => [state_glue(states), self.functions(kernel), self.drive()].join("\n"),
        };
        [FINITE, FOLD, &lanes, &finite_glue(states), &moves, JUDGE].join("\n")
    }

    /// `state_distance`, the Euclidean distance of two states.
    fn distance(&self) -> String {
        let states = self.outline.states;
        // A kernel's state may be longer than what is stored of it.
        let passed = |name: &str| match (states, &self.chain) {
            (1, _) => format!("{name}[0]"),
            (_, None) => name.to_owned(),
            (_, Some(_)) => {
                let all: Vec<String> = (0..states).map(|i| format!("{name}[{i}]")).collect();
                format!("array<f32, {states}>({})", all.join(", "))
            }
        };
        let (recorded, a, b) = (recorded_distance(states), passed("a"), passed("b"));
        format!(
            "{recorded}\nfn state_distance(a: array<f32, NX>, b: array<f32, NX>) -> f32 {{\n    \
             return distance_of({a}, {b});\n}}\n"
        )
    }

    /// What evaluates the inputs of a network.
    fn observation(&self) -> String {
        let quads = self.outline.driving.as_ref().map_or(0, |driving| driving.inputs.div_ceil(4));
        let mut store = String::from("fn store_seen(column: u32, seen: array<f32, SEEN>) {\n");
        for quad in 0..quads {
            let entries = super::glue::padded("seen", quad, self.seen());
            store += &format!("    sink[{quad}u * params.stride + column] = {entries};\n");
        }
        [load_glue(self.outline.states, &[]), self.functions(Kernel::Observe), store + "}\n"]
            .join("\n")
    }

    /// Numbers that the network sees.
    fn seen(&self) -> usize {
        self.outline.driving.as_ref().map_or(0, |driving| driving.inputs)
    }

    /// The recorded functions that `kernel` calls, and what calls them.
    fn functions(&self, kernel: Kernel) -> String {
        let roles = self.roles(kernel);
        let functions: Vec<&Function> =
            roles.iter().filter_map(|role| self.physics.function(*role)).collect();
        // What a network with kernels of its own sees is asked at samples alone.
        let points = if kernel == Kernel::Observe { 1 } else { self.outline.points };
        physics_glue(&Outline { points, ..self.outline.clone() }, &functions)
    }

    /// The recorded functions that `kernel` calls.
    fn roles(&self, kernel: Kernel) -> Vec<Role> {
        let roles = match kernel {
            // The links of the chain have them in parts.
            _ if self.chain.is_some() => Vec::new(),
            Kernel::Observe => vec![Role::Observe],
            Kernel::ReachAvoid | Kernel::Deviation => {
                let mut roles =
                    vec![Role::Step, Role::Target, Role::Constraint, Role::Control, Role::Act];
                roles.extend(self.fused().map(|_| Role::Observe));
                roles
            }
            _ => Vec::new(),
        };
        roles.into_iter().filter(|role| self.physics.function(*role).is_some()).collect()
    }

    fn reads(&self, role: Role, part: Part) -> bool {
        self.physics.function(role).is_some_and(|function| function.reads(part))
    }

    /// `drive`: the controls at a state, by the formula, from the last layer's outputs, or by the
    /// network that the rollout runs itself.
    fn drive(&self) -> String {
        let Some(driving) = &self.outline.driving else {
            return "fn drive(lane: u32, column: u32, x: array<f32, NX>, t: u32) \
                    -> array<f32, NU> {\n    \
                    return control_of(x, t);\n}\n"
                .to_owned()
                + NOTHING_TO_BEGIN;
        };
        if let Some(fused) = &driving.fused {
            return fused_text(fused, driving.outputs);
        }
        let slot = Slot::Control as u32;
        let mut text = format!(
            "@group(0) @binding({slot}) var<storage, read> control: array<vec4<f32>>;\n\
             fn drive(lane: u32, column: u32, x: array<f32, NX>, t: u32) -> array<f32, NU> {{\n    \
             let stride = params.stride * (1u + params.paired);\n"
        );
        for quad in 0..driving.outputs.div_ceil(4) {
            text += &format!("    let v{quad} = control[{quad}u * stride + column];\n");
        }
        let all: Vec<String> = (0..driving.outputs).map(component).collect();
        text += &format!("    return acted(x, array<f32, SAID>({}), t);\n}}\n", all.join(", "));
        text + NOTHING_TO_BEGIN
    }
}

/// The WGSL module of `kernel`, one of those of the layers of `mlp`, whoever it drives.
pub(in super::super) fn layer_kernel(mlp: &Mlp, kernel: Kernel) -> String {
    let DrivingNetwork { kinds, inputs, outputs, .. } = DrivingNetwork::new(mlp);
    let text = layer_text(&kinds, kernel);
    [constants(inputs, outputs), PARAMS.to_owned(), CHOICES.to_owned(), text].join("\n")
}

/// `normal_pair` and `ln_unit`, with the bits of the host.
fn recorded_normals() -> String {
    let logarithm = record(1, |u| vec![u[0].ln_unit()]);
    let exact = Arithmetic::Exact;
    [function_with("ln_unit", &[("u", 1)], &logarithm, exact), recorded_pair(exact)].join("\n")
}

/// `distance_of`, the Euclidean distance of two states.
fn recorded_distance(states: usize) -> String {
    let graph = record(2 * states, |both| {
        let (nominal, perturbed) = both.split_at(states);
        let square = nominal.iter().zip(perturbed).fold(Expr::lit(0.0), |sum, (&a, &b)| {
            let gap = b - a;
            sum + gap * gap
        });
        vec![square.sqrt()]
    });
    function("distance_of", &[("a", states), ("b", states)], &graph)
}
