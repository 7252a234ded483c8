//! Who drives a model: a formula, or a network with what stands around it.

use std::borrow::Cow;
use std::sync::Arc;

use crate::formula::{Graph, record};
use crate::policy::{Mlp, Parts, Policy};
use crate::system::System;
use crate::tile::{CompiledPolicy, NativeFormula};

use super::Model;
use super::compiled::CompiledForm;
use super::recorded::recorded;

/// A policy as data.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Short name for reports.
    pub name: String,
    /// How the controls come about.
    pub law: Law,
    /// The formula as compiled, where it is written in Rust.
    native: Option<Arc<CompiledForm<dyn NativeFormula>>>,
}

/// How controls come about.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// A formula, `[controls]`, of the inputs of the model.
    Formula(Graph),
    /// A network.
    Network {
        /// What it sees, of the inputs of the model; the states in order if nothing is said.
        observe: Option<Graph>,
        /// The network.
        network: Arc<Mlp>,
        /// The controls, of the inputs of the model followed by what the network says; that itself
        /// if nothing is said.
        act: Option<Graph>,
    },
}

impl Controller {
    /// A network that sees the states in order and says the controls.
    pub fn network_alone(network: impl Into<Arc<Mlp>>) -> Self {
        let network = network.into();
        Self::new(network.in_words(), Law::Network { observe: None, network, act: None })
    }

    /// A network that says the controls of `model` and sees the states that its file names in `state_order`,
    /// in that order; all states in order where it names none.
    ///
    /// ```
    /// use reachcast::model::{Controller, Model};
    /// use reachcast::policy::{Activation, Layer, Mlp};
    /// use reachcast::system::DoubleIntegrator;
    /// let layer = Layer::dense(vec![-2.0], vec![0.0]);
    /// let network = Mlp::new(vec![layer], Activation::Relu, Activation::Identity)?;
    /// let damper = network.with_state_order(vec!["velocity".to_owned()])?;
    /// let model = Model::of(DoubleIntegrator::default());
    /// let controller = Controller::network_of(&model, damper).map_err(|e| reachcast::Error::invalid("policy", e))?;
    /// let plant = reachcast::model::Plant::new(model, controller);
    /// assert_eq!(plant.control(&[0.5_f32, 0.25], 0), [-0.5]);
    /// # Ok::<(), reachcast::Error>(())
    /// ```
    ///
    /// # Errors
    /// What is wrong, in words: inputs or outputs that do not fit, a name that is no state.
    pub fn network_of(
        model: &Model,
        network: impl Into<Arc<Mlp>>,
    ) -> std::result::Result<Self, String> {
        let network = network.into();
        let (widths, controls) = (network.widths(), model.controls.len());
        let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
        if outputs != controls {
            return Err(format!(
                "the network maps {inputs} inputs to {outputs} outputs, the system has {} states and \
                 {controls} controls",
                model.states.len()
            ));
        }
        let names: Vec<&str> = model.states.iter().map(|axis| axis.name.as_str()).collect();
        let places = network.places_among(&names)?;
        let observe = places.map(|places| picked(model.inputs(), &places));
        Ok(Self::new(network.in_words(), Law::Network { observe, network, act: None }))
    }

    /// A policy as data, without anything compiled.
    pub fn new(name: impl Into<String>, law: Law) -> Self {
        Self { name: name.into(), law, native: None }
    }

    /// The controller that `policy` is for the model of `system`: its network, or its formula
    /// recorded and kept as compiled.
    pub fn of<S, P, const NX: usize, const NU: usize>(system: &S, policy: P) -> Self
    where
        S: System<NX, NU>,
        P: Policy<NX, NU> + Send + Sync + 'static,
    {
        let controller = Self::recorded(system, &policy);
        let native = match &controller.law {
            Law::Formula(graph) => {
                let code: Arc<dyn NativeFormula> = Arc::new(CompiledPolicy(policy));
                let parameters = system.parameters();
                let values = parameters.iter().map(|parameter| parameter.value).collect();
                Some(CompiledForm::new(code, &[graph], values))
            }
            Law::Network { .. } => None,
        };
        Self { native, ..controller }
    }

    /// The same of a policy that is borrowed, without its compiled form.
    fn recorded<S, P, const NX: usize, const NU: usize>(system: &S, policy: &P) -> Self
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let law = match policy.network() {
            Some(network) => {
                let network = Arc::new(network.clone());
                Law::Network { observe: None, network, act: None }
            }
            None => Law::Formula(recorded(system, |x, _| policy.control(x).to_vec())),
        };
        Self::new(policy.name(), law)
    }

    /// The same with the maps at the ends of its network among the formulas around it, as those run it that know layers
    /// alone; the formulas are of the inputs of `model`.
    pub(crate) fn unmapped(&self, model: &Model) -> Cow<'_, Self> {
        let Law::Network { observe, network, act } = &self.law else { return Cow::Borrowed(self) };
        if !network.is_mapped() {
            return Cow::Borrowed(self);
        }
        let Parts { input, core, output } = network.parts();
        let (inputs, states) = (model.inputs(), model.states.len());
        let observe = match input {
            None => observe.clone(),
            Some(map) => Some(record(inputs, |x| match observe {
                Some(observe) => map.apply(&observe.recorded_at(x)),
                None => map.apply(&x[..states]),
            })),
        };
        let act = match output {
            None => act.clone(),
            Some(map) => Some(record(inputs + map.scale.len(), |x| {
                let (own, said) = x.split_at(inputs);
                let said = map.apply(said);
                match act {
                    Some(act) => act.recorded_at(&[own, &said].concat()),
                    None => said,
                }
            })),
        };
        Cow::Owned(Self::new(self.name.clone(), Law::Network { observe, network: core, act }))
    }

    /// The network, if there is one.
    pub fn network(&self) -> Option<&Mlp> {
        match &self.law {
            Law::Formula(_) => None,
            Law::Network { network, .. } => Some(network),
        }
    }

    /// The network, if there is one, as it is shared.
    pub fn shared_network(&self) -> Option<&Arc<Mlp>> {
        match &self.law {
            Law::Formula(_) => None,
            Law::Network { network, .. } => Some(network),
        }
    }

    /// The compiled form of a formula, where it and the `values` of the model's parameters are still
    /// those that it was compiled with.
    pub(crate) fn compiled(&self, values: &[f32]) -> Option<&Arc<dyn NativeFormula>> {
        match &self.law {
            Law::Formula(graph) => self.native.as_ref()?.of(&[graph], values),
            Law::Network { .. } => None,
        }
    }
}

/// The formulas that hand on the inputs at `places`, of a model with as many `inputs`.
pub(crate) fn picked(inputs: usize, places: &[usize]) -> Graph {
    record(inputs, |x| places.iter().map(|place| x[*place]).collect())
}
