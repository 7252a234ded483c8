//! Multi-layer perceptrons.

use std::sync::Arc;

use crate::digest;
use crate::error::{Error, Result};
use crate::real::Real;

/// Activation of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// `max(0, x)`.
    Relu,
    /// Hyperbolic tangent.
    Tanh,
    /// `x / (1 + exp(-x))`.
    Silu,
}

impl Activation {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Relu => "relu",
            Self::Tanh => "tanh",
            Self::Silu => "silu",
        }
    }

    /// The activation at `x`; NaN stays NaN.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        let half = R::lit(0.5);
        match self {
            Self::Relu => x.if_lt(R::lit(0.0), R::lit(0.0), x),
            Self::Tanh => x.tanh(),
            // The logistic function is (1 + tanh(x / 2)) / 2.
            Self::Silu => {
                let scaled = half * x;
                scaled + scaled * scaled.tanh()
            }
        }
    }
}

/// Activation of the last layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputActivation {
    /// Hyperbolic tangent: controls in `[-1, 1]`.
    Tanh,
    /// None.
    Identity,
}

impl OutputActivation {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tanh => "tanh",
            Self::Identity => "identity",
        }
    }

    /// The activation at `x`.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        match self {
            Self::Tanh => x.tanh(),
            Self::Identity => x,
        }
    }
}

/// One dense layer, `y = W x + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// `W`, `[outputs, inputs]` row by row.
    pub weight: Vec<f32>,
    /// `b`, `[outputs]`.
    pub bias: Vec<f32>,
    /// Columns of `W`.
    pub inputs: usize,
    /// Rows of `W`.
    pub outputs: usize,
}

/// A dense network.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    /// Shared by copies of the network.
    pub(super) layers: Arc<[Layer]>,
    pub(super) activation: Activation,
    pub(super) output: OutputActivation,
    pub(super) state_order: Option<Vec<String>>,
}

impl Mlp {
    /// A network from its layers.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no layer, a shape does not fit its neighbour, or a weight
    /// is not finite.
    pub fn new(
        layers: Vec<Layer>,
        activation: Activation,
        output: OutputActivation,
    ) -> Result<Self> {
        let mlp = Self { layers: layers.into(), activation, output, state_order: None };
        mlp.validate().map_err(|problem| Error::invalid("network", problem))?;
        Ok(mlp)
    }

    /// The same network with the names of its inputs.
    ///
    /// # Errors
    /// [`Error::Invalid`] if they are not one name per input, all different and without commas.
    pub fn with_state_order(mut self, names: Vec<String>) -> Result<Self> {
        let inputs = self.widths()[0];
        let plain = |name: &String| !name.is_empty() && !name.contains(',') && name.trim() == name;
        let twice = (1..names.len()).any(|i| names[..i].contains(&names[i]));
        if names.len() != inputs || twice || !names.iter().all(plain) {
            let given = names.join(",");
            let problem =
                format!("`{given}`; expected {inputs} names, one per input, all different");
            return Err(Error::invalid("state order", problem));
        }
        self.state_order = Some(names);
        Ok(self)
    }

    /// The layers, input side first.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Whether `other` is this network or a copy of it, told without a look at its numbers.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let shape = (self.activation, self.output) == (other.activation, other.output);
        shape && Arc::ptr_eq(&self.layers, &other.layers)
    }

    /// Activation of the hidden layers.
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// Activation of the last layer.
    pub fn output(&self) -> OutputActivation {
        self.output
    }

    /// Names of the inputs, where the file has them.
    pub fn state_order(&self) -> Option<&[String]> {
        self.state_order.as_deref()
    }

    /// Input width, then the output width of each layer.
    pub fn widths(&self) -> Vec<usize> {
        let first = self.layers.first().map(|layer| layer.inputs);
        first.into_iter().chain(self.layers.iter().map(|layer| layer.outputs)).collect()
    }

    /// Number of weights and biases.
    pub fn parameter_count(&self) -> usize {
        self.layers.iter().map(|layer| layer.weight.len() + layer.bias.len()).sum()
    }

    /// SHA-256 over widths, activations and parameters, in hexadecimal.
    pub fn digest(&self) -> String {
        let shape = format!("{:?} {:?} {:?}", self.widths(), self.activation, self.output);
        let parameters = self.layers.iter().flat_map(|layer| [&layer.weight, &layer.bias]);
        let bytes = parameters.map(|values| bytemuck::cast_slice(values));
        digest::sha256(std::iter::once(shape.as_bytes()).chain(bytes))
    }

    /// Checks the network against a system of `states` (names in order) and `controls`.
    ///
    /// # Errors
    /// A sentence that names both shapes, or the first state out of order.
    pub fn check_fits(&self, states: &[&str], controls: usize) -> std::result::Result<(), String> {
        let widths = self.widths();
        let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
        if (inputs, outputs) != (states.len(), controls) {
            return Err(format!(
                "the network maps {inputs} inputs to {outputs} outputs, \
                 the system has {} states and {controls} controls",
                states.len()
            ));
        }
        match &self.state_order {
            Some(order) if order.iter().ne(states) => Err(format!(
                "state_order `{}` is not the system's `{}`",
                order.join(","),
                states.join(",")
            )),
            _ => Ok(()),
        }
    }

    /// The places of its inputs among `states`, where the file names a part of them or another order; none
    /// where it sees all in order.
    ///
    /// # Errors
    /// What is wrong, in words: a name that is no state, or inputs without names that are not as many.
    pub fn places_among(&self, states: &[&str]) -> std::result::Result<Option<Vec<usize>>, String> {
        let Some(order) = &self.state_order else {
            let (inputs, count) = (self.widths()[0], states.len());
            let problem = || {
                format!(
                    "the network takes {inputs} inputs, the model has {count} states, {}; `state_order` in \
                     the file names those that it sees",
                    states.join(", ")
                )
            };
            return (inputs == count).then_some(None).ok_or_else(problem);
        };
        let place = |name: &String| {
            states.iter().position(|state| state == name).ok_or_else(|| {
                format!("its input `{name}` is none of the states `{}`", states.join(","))
            })
        };
        let places = order.iter().map(place).collect::<std::result::Result<Vec<_>, _>>()?;
        let all = places.iter().copied().eq(0..states.len());
        Ok((!all).then_some(places))
    }

    /// The output for `input`, one neuron after the other: the reference for the backends.
    ///
    /// # Panics
    /// If `input` has not the input width.
    pub fn forward<R: Real>(&self, input: &[R]) -> Vec<R> {
        assert_eq!(input.len(), self.layers[0].inputs, "input width of the network");
        let mut x = input.to_vec();
        for (i, layer) in self.layers.iter().enumerate() {
            let last = i + 1 == self.layers.len();
            let activate =
                |sum: R| if last { self.output.apply(sum) } else { self.activation.apply(sum) };
            let sums = R::dense(&layer.weight, &layer.bias, &x);
            x = sums.into_iter().map(activate).collect();
        }
        x
    }

    /// Its kind and widths: `mlp 12-64-64-3`.
    pub fn in_words(&self) -> String {
        let widths: Vec<String> = self.widths().iter().map(ToString::to_string).collect();
        format!("mlp {}", widths.join("-"))
    }

    /// Refuses a network without layers, with shapes that do not fit, or a weight not finite.
    pub(super) fn validate(&self) -> std::result::Result<(), String> {
        if self.layers.is_empty() {
            return Err("no tensor `layers.0.weight`: the network has no layer".to_owned());
        }
        for (i, layer) in self.layers.iter().enumerate() {
            let shape = layer.outputs.checked_mul(layer.inputs);
            if layer.inputs == 0 || shape != Some(layer.weight.len()) || layer.outputs == 0 {
                return Err(format!("layers.{i}.weight has not the shape [out, in]"));
            }
            if layer.bias.len() != layer.outputs {
                return Err(format!(
                    "layers.{i}.bias has {} entries, layers.{i}.weight has {} rows",
                    layer.bias.len(),
                    layer.outputs
                ));
            }
            if let Some(before) = i.checked_sub(1).map(|before| &self.layers[before])
                && before.outputs != layer.inputs
            {
                return Err(format!(
                    "layers.{i}.weight has {} columns, layers.{} has {} outputs",
                    layer.inputs,
                    i - 1,
                    before.outputs
                ));
            }
            for (kind, values) in [("weight", &layer.weight), ("bias", &layer.bias)] {
                if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                    return Err(format!("layers.{i}.{kind}[{at}] is {}, not finite", values[at]));
                }
            }
        }
        Ok(())
    }
}
