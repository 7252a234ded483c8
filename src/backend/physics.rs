//! The physics of a plant as WGSL text: what shaders are built from and certificates hash.

use crate::formula::wgsl::careful_function;
use crate::formula::{Graph, Node};
use crate::model::{Controller, Law, Model, Plant};

/// The recorded step, target margin, constraint margin and what there is of control, observation
/// and action, as WGSL functions `plant_step`, `plant_target`, `plant_constraint`,
/// `plant_control`, `plant_observe`, `plant_act`.
///
/// Arrays of states and controls are `array<f32, N>`, a single one is an `f32`. Parameters are
/// arguments: their values are no part of the text. A network has no text: its digest is
/// [`crate::policy::Mlp::digest`].
///
/// ```
/// use reachcast::backend::physics;
/// use reachcast::model::Plant;
/// use reachcast::system::{BangBang, DoubleIntegrator};
/// let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
/// let text = physics(&plant);
/// assert!(text.starts_with("fn plant_step(x: array<f32, 2>, u: f32"));
/// assert!(text.contains("fn plant_control(x: array<f32, 2>"));
/// ```
pub fn physics(plant: &Plant) -> String {
    Physics::new(&plant.model, &plant.controller).text()
}

/// Which function of the physics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    not(feature = "gpu"),
    expect(dead_code, reason = "adapters alone print what plans cost")
)]
pub(crate) enum Role {
    /// The next state.
    Step,
    /// The target margin.
    Target,
    /// The constraint margin.
    Constraint,
    /// The controls of a formula.
    Control,
    /// What a network sees.
    Observe,
    /// The controls from what a network says.
    Act,
    /// The cost of a stage of a plan.
    Stage,
    /// The numbers of the cells that it asks.
    StagePlaces,
    /// The number of the cell of a map.
    Cell,
    /// The cost of the end of a plan.
    Terminal,
    /// The numbers of the cells that it asks.
    TerminalPlaces,
}

impl Role {
    /// Name of the WGSL function.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Step => "plant_step",
            Self::Target => "plant_target",
            Self::Constraint => "plant_constraint",
            Self::Control => "plant_control",
            Self::Observe => "plant_observe",
            Self::Act => "plant_act",
            Self::Stage => "stage_cost",
            Self::StagePlaces => "stage_cells",
            Self::Cell => "map_cell",
            Self::Terminal => "terminal_cost",
            Self::TerminalPlaces => "terminal_cells",
        }
    }

    /// What it takes even where it does not read it.
    fn always(self, part: Part) -> bool {
        match part {
            Part::State => true,
            Part::Control => matches!(self, Self::Step | Self::Stage),
            Part::Said => self == Self::Act,
            Part::Parameters | Part::Seconds | Part::Step | Part::Context | Part::Looked => false,
        }
    }
}

/// A part of the inputs of a model's formulas, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// The states.
    State,
    /// The controls.
    Control,
    /// The parameters.
    Parameters,
    /// The time, s.
    Seconds,
    /// The number of the step.
    Step,
    /// What the network says.
    Said,
    /// What the cost of a stage wants to know.
    Context,
    /// What the maps say that it asks.
    Looked,
}

impl Part {
    /// In the order of the inputs; whoever is told by a network has no context.
    const ALL: [Self; 8] = [
        Self::State,
        Self::Control,
        Self::Parameters,
        Self::Seconds,
        Self::Step,
        Self::Said,
        Self::Context,
        Self::Looked,
    ];

    /// Name of the argument.
    fn name(self) -> &'static str {
        match self {
            Self::State => "x",
            Self::Control => "u",
            Self::Parameters => "p",
            Self::Seconds => "seconds",
            Self::Step => "number",
            Self::Said => "said",
            Self::Context => "context",
            Self::Looked => "looked",
        }
    }
}

/// A function of the physics.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Function {
    pub(crate) role: Role,
    /// Its WGSL text.
    pub(crate) text: String,
    /// What it takes, in this order.
    pub(crate) takes: Vec<Part>,
    /// Numbers that it gives.
    pub(crate) outputs: usize,
}

impl Function {
    /// Prints `graph`, a formula of `model`; behind the inputs of the model it takes as many numbers
    /// of a network, of context and of maps as `more` says.
    pub(crate) fn of(model: &Model, role: Role, graph: &Graph, more: [usize; 3]) -> Self {
        let (states, controls) = (model.states.len(), model.controls.len());
        let [said, context, looked] = more;
        let lengths = [states, controls, model.parameters.len(), 1, 1, said, context, looked];
        Self::new(role, graph, lengths)
    }

    /// Prints `graph`, whose inputs are `lengths` of each part: what it does not read is no
    /// argument, so that nobody pays for it.
    fn new(role: Role, graph: &Graph, lengths: [usize; 8]) -> Self {
        let mut read = vec![false; graph.inputs];
        for node in &graph.nodes {
            if let Node::Input(input) = node {
                read[*input as usize] = true;
            }
        }
        let (mut at, mut place) = (0, vec![0; graph.inputs]);
        let (mut takes, mut arguments, mut taken) = (Vec::new(), Vec::new(), 0);
        for (part, length) in Part::ALL.into_iter().zip(lengths) {
            let end = (at + length).min(graph.inputs);
            let inputs = at.min(end)..end;
            at += length;
            let wanted = role.always(part) || read[inputs.clone()].contains(&true);
            if inputs.is_empty() || !wanted {
                continue;
            }
            takes.push(part);
            arguments.push((part.name(), length));
            inputs.clone().zip(taken..).for_each(|(input, to)| place[input] = to);
            taken += length as u32;
        }
        let moved = moved(graph, &place, taken);
        let text = careful_function(role.name(), &arguments, &moved);
        Self { role, text, takes, outputs: graph.outputs.len() }
    }
}

/// `graph` with its inputs at other places, `count` in all.
fn moved(graph: &Graph, place: &[u32], count: u32) -> Graph {
    let node = |node: &Node| match *node {
        Node::Input(input) => Node::Input(place[input as usize]),
        other => other,
    };
    Graph {
        inputs: count as usize,
        nodes: graph.nodes.iter().map(node).collect(),
        outputs: graph.outputs.clone(),
        calls: graph.calls.clone(),
    }
}

/// The functions of a plant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Physics {
    pub(crate) functions: Vec<Function>,
}

impl Physics {
    /// Prints the formulas of `model` and `controller`.
    pub(crate) fn new(model: &Model, controller: &Controller) -> Self {
        let mut graphs = vec![
            (Role::Step, &model.step),
            (Role::Target, &model.target),
            (Role::Constraint, &model.constraint),
        ];
        let mut said = 0;
        match &controller.law {
            Law::Formula(graph) => graphs.push((Role::Control, graph)),
            Law::Network { observe, network, act } => {
                said = network.widths().last().copied().unwrap_or(0);
                graphs.extend(observe.iter().map(|graph| (Role::Observe, graph)));
                graphs.extend(act.iter().map(|graph| (Role::Act, graph)));
            }
        }
        let print = |(role, graph): (Role, &Graph)| Function::of(model, role, graph, [said, 0, 0]);
        Self { functions: graphs.into_iter().map(print).collect() }
    }

    /// All functions, one after the other.
    pub(crate) fn text(&self) -> String {
        let texts: Vec<&str> = self.functions.iter().map(|one| one.text.as_str()).collect();
        texts.join("\n")
    }
}
