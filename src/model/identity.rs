//! The text of a plant: what its certificates hash.

use std::fmt::Write;

use super::{Law, Model, Plant};
use crate::formula::wgsl::function;
use crate::formula::{Graph, Node};

impl Plant {
    /// Every formula of the plant as a function, then the values of the parameters: equal texts are
    /// equal plants, whoever wrote them. A network has no text: its digest is
    /// [`crate::policy::Mlp::digest`].
    ///
    /// ```
    /// use reachcast::model::Plant;
    /// use reachcast::system::{BangBang, DoubleIntegrator};
    /// let text = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 }).text();
    /// assert!(text.contains("fn plant_step(") && text.contains("fn plant_control("));
    /// ```
    pub fn text(&self) -> String {
        let Self { model, controller } = self;
        let mut text = [
            model.function("plant_step", &model.step, 0),
            model.function("plant_target", &model.target, 0),
            model.function("plant_constraint", &model.constraint, 0),
        ]
        .join("\n");
        let laws = match &controller.law {
            Law::Formula(graph) => vec![("plant_control", graph, 0)],
            Law::Network { observe, act, network } => {
                let outputs = network.widths().last().copied().unwrap_or(0);
                let observe = observe.iter().map(|graph| ("plant_observe", graph, 0));
                observe.chain(act.iter().map(|graph| ("plant_act", graph, outputs))).collect()
            }
        };
        for (name, graph, more) in laws {
            text.push('\n');
            text += &model.function(name, graph, more);
        }
        // The open reach-avoid task goes without saying, so that its plants have the same text as ever.
        if !model.task.is_plain() {
            writeln!(text, "// task {}", model.task).expect("a String grows");
        }
        if model.points > 1 {
            writeln!(text, "// between {}", model.points - 1).expect("a String grows");
        }
        for parameter in &model.parameters {
            // The bits, so that no decimal hides a difference.
            let (name, value) = (&parameter.name, parameter.value);
            writeln!(text, "// {name} = {value:?} ({:08x})", value.to_bits())
                .expect("a String grows");
        }
        // Where no formula reads the time, how long a step lasts is in the formulas already.
        if let Some(period) = model.period.filter(|_| self.reads_seconds()) {
            writeln!(text, "// period = {period:?} s").expect("a String grows");
        }
        text
    }

    /// Whether a formula reads the time in seconds, the last input but one of the model's.
    fn reads_seconds(&self) -> bool {
        let Self { model, controller } = self;
        let laws = match &controller.law {
            Law::Formula(graph) => [Some(graph), None],
            Law::Network { observe, act, .. } => [observe.as_ref(), act.as_ref()],
        };
        let seconds = Node::Input(model.inputs() as u32 - 2);
        let graphs = [&model.step, &model.target, &model.constraint].into_iter();
        graphs.chain(laws.into_iter().flatten()).any(|graph| graph.nodes.contains(&seconds))
    }
}

impl Model {
    /// Every formula of the model as a function, its task and the values of its parameters, whoever
    /// drives it: equal texts are equal models.
    pub fn text(&self) -> String {
        let formulas =
            [("step", &self.step), ("target", &self.target), ("constraint", &self.constraint)];
        let formulas = formulas.map(|(name, graph)| self.function(name, graph, 0));
        let bits = |value: f32| format!("{:08x}", value.to_bits());
        let values: Vec<String> = self.values().into_iter().map(bits).collect();
        let period = self.period.map_or_else(|| "none".to_owned(), bits);
        format!(
            "{}// task {}\n// parameters {}\n// period {period}\n",
            formulas.concat(),
            self.task,
            values.join(" ")
        )
    }

    /// A formula of the model as a function `name`, with `more` inputs behind the model's.
    fn function(&self, name: &str, graph: &Graph, more: usize) -> String {
        let (x, u) = (self.states.len(), self.controls.len());
        let sizes =
            [("x", x), ("u", u), ("p", self.parameters.len()), ("t", 1), ("k", 1), ("out", more)];
        let arguments: Vec<(&str, usize)> =
            sizes.into_iter().filter(|(_, length)| *length > 0).collect();
        function(name, &arguments, graph)
    }
}
