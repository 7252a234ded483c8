//! Multi-layer perceptrons.

use std::sync::Arc;

use super::{Activation, Layer, Rescale};
use crate::digest;
use crate::error::{Error, Result};
use crate::real::Real;

/// A dense network, and the maps at its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    /// Shared by copies of the network.
    layers: Arc<[Layer]>,
    /// What a file without hidden layers says of them; else that of the first one.
    hidden: Activation,
    /// What its inputs go through.
    input: Option<Arc<Rescale>>,
    /// What its outputs go through.
    output: Option<Arc<Rescale>>,
    state_order: Option<Vec<String>>,
}

impl Mlp {
    /// A network from its layers, `hidden` behind each but the last, and `last` behind that.
    ///
    /// # Errors
    /// As those of [`Mlp::from_layers`].
    pub fn new(mut layers: Vec<Layer>, hidden: Activation, last: Activation) -> Result<Self> {
        let count = layers.len();
        for (i, layer) in layers.iter_mut().enumerate() {
            layer.activation = if i + 1 == count { last } else { hidden };
        }
        Self { hidden, ..Self::bare(layers) }.checked()
    }

    /// A network from its layers, each with an activation of its own.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no layer, a shape does not fit its neighbour, a parameter of an activation has
    /// no sense, or a number is not finite.
    pub fn from_layers(layers: Vec<Layer>) -> Result<Self> {
        Self::bare(layers).checked()
    }

    /// The network of these layers, unchecked.
    fn bare(layers: Vec<Layer>) -> Self {
        let hidden = match layers.as_slice() {
            [first, _, ..] => first.activation,
            _ => Activation::Relu,
        };
        Self { layers: layers.into(), hidden, input: None, output: None, state_order: None }
    }

    fn checked(self) -> Result<Self> {
        self.validate().map_err(|problem| Error::invalid("network", problem))?;
        Ok(self)
    }

    /// The same network behind a map of its inputs.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the map has another size, a number that is not finite, or a limit that is not below the
    /// other.
    pub fn with_input(self, map: Rescale) -> Result<Self> {
        Self { input: Some(Arc::new(map)), ..self }.checked()
    }

    /// The same network before a map of its outputs.
    ///
    /// # Errors
    /// As those of [`Mlp::with_input`].
    pub fn with_output(self, map: Rescale) -> Result<Self> {
        Self { output: Some(Arc::new(map)), ..self }.checked()
    }

    /// The same network with the names of its inputs.
    ///
    /// # Errors
    /// [`Error::Invalid`] if they are not one name per input, all different and without commas.
    pub fn with_state_order(mut self, names: Vec<String>) -> Result<Self> {
        let inputs = self.widths()[0];
        let plain = |name: &String| !name.is_empty() && !name.contains(',') && name.trim() == name;
        if let Some(name) = names.iter().find(|name| name.chars().any(is_invisible)) {
            let problem =
                format!("{name:?} has characters that control a terminal or are not seen");
            return Err(Error::invalid("state order", problem));
        }
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
        let same = |one: &Option<Arc<Rescale>>, other: &Option<Arc<Rescale>>| match (one, other) {
            (None, None) => true,
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            _ => false,
        };
        let maps = same(&self.input, &other.input) && same(&self.output, &other.output);
        maps && Arc::ptr_eq(&self.layers, &other.layers)
    }

    /// Activation of the hidden layers; none where they differ.
    pub fn activation(&self) -> Option<Activation> {
        let hidden = &self.layers[..self.layers.len() - 1];
        hidden.iter().all(|layer| layer.activation == self.hidden).then_some(self.hidden)
    }

    /// The activation of the hidden layers in words; where they differ, of each of them.
    pub fn hidden_words(&self) -> String {
        let hidden = self.layers[..self.layers.len() - 1].iter();
        let each = || hidden.map(|layer| layer.activation.name()).collect::<Vec<_>>().join(", ");
        self.activation().map_or_else(each, Activation::name)
    }

    /// Activation of the last layer.
    pub fn output(&self) -> Activation {
        self.layers.last().map_or(Activation::Identity, |layer| layer.activation)
    }

    /// What its inputs go through before the first layer.
    pub fn input_map(&self) -> Option<&Rescale> {
        self.input.as_deref()
    }

    /// What the outputs of the last layer go through.
    pub fn output_map(&self) -> Option<&Rescale> {
        self.output.as_deref()
    }

    /// The same network with other layers of the same shapes, without maps.
    pub(super) fn of_layers(&self, layers: Vec<Layer>) -> Self {
        let same = layers == *self.layers;
        let layers = if same { Arc::clone(&self.layers) } else { layers.into() };
        Self { layers, hidden: self.hidden, input: None, output: None, state_order: None }
    }

    /// Whether a layer has a norm.
    pub fn has_norm(&self) -> bool {
        self.layers.iter().any(|layer| layer.norm.is_some())
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

    /// Number of weights and biases, those of norms among them.
    pub fn parameter_count(&self) -> usize {
        let norms = self.layers.iter().filter_map(|layer| layer.norm.as_ref());
        let norms: usize = norms.map(|norm| norm.scale.len() + norm.shift.len()).sum();
        self.layers.iter().map(|layer| layer.weight.len() + layer.bias.len()).sum::<usize>() + norms
    }

    /// SHA-256 over widths, activations and parameters, in hexadecimal; over norms and maps, too, where there are
    /// some.
    pub fn digest(&self) -> String {
        let shape = self.shape();
        digest::sha256(std::iter::once(shape.as_bytes()).chain(self.numbers()))
    }

    /// What the digest has of it besides numbers: two networks with the same numbers in the same order, which are
    /// not the same, differ here.
    fn shape(&self) -> String {
        let widths = self.widths();
        let plain = !self.has_norm() && self.input.is_none() && self.output.is_none();
        if let Some(hidden) = self.activation().filter(|_| plain) {
            return format!("{widths:?} {hidden:?} {:?}", self.output());
        }
        let layers = self.layers.iter();
        let norm = |layer: &Layer| layer.norm.as_ref().map(|norm| norm.epsilon);
        let layers: Vec<_> = layers.map(|layer| (layer.activation, norm(layer))).collect();
        let maps = [&self.input, &self.output];
        let centered = maps.map(|map| map.as_ref().is_some_and(|map| map.is_centered()));
        let maps = maps.map(|map| map.is_some());
        let centers = if centered == [false; 2] { String::new() } else { format!(" {centered:?}") };
        format!("{widths:?} {layers:?} {:?} {maps:?}{centers}", self.hidden)
    }

    /// The bytes of all numbers: layer by layer weights, biases and those of the norm, then the maps.
    fn numbers(&self) -> impl Iterator<Item = &[u8]> {
        let layers = self.layers.iter().flat_map(|layer| {
            let norm = layer.norm.iter().flat_map(|norm| [&norm.scale, &norm.shift]);
            [&layer.weight, &layer.bias].into_iter().chain(norm)
        });
        let maps = [&self.input, &self.output].into_iter().flatten();
        let maps = maps.flat_map(|map| map.tensors().map(|(_, values)| values));
        layers.chain(maps).map(|values| bytemuck::cast_slice(values))
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
        let seen = self.input.as_ref().map_or_else(|| input.to_vec(), |map| map.apply(input));
        let said = self.layers.iter().fold(seen, |x, layer| layer.forward(&x));
        match &self.output {
            Some(map) => map.apply(&said),
            None => said,
        }
    }

    /// Its kind and widths, `mlp 12-64-64-3`, and what else it has: norms, which adapters run in layers, and maps.
    pub fn in_words(&self) -> String {
        let widths: Vec<String> = self.widths().iter().map(ToString::to_string).collect();
        let norms = if self.has_norm() { ", norms in layers" } else { "" };
        let maps = match (&self.input, &self.output) {
            (None, None) => "",
            (Some(_), None) => ", map of inputs",
            (None, Some(_)) => ", map of outputs",
            (Some(_), Some(_)) => ", maps of inputs and outputs",
        };
        format!("mlp {}{norms}{maps}", widths.join("-"))
    }

    /// Refuses a network without layers, with shapes that do not fit, or a number not finite.
    pub(super) fn validate(&self) -> std::result::Result<(), String> {
        if self.layers.is_empty() {
            return Err("no tensor `layers.0.weight`: the network has no layer".to_owned());
        }
        for (i, layer) in self.layers.iter().enumerate() {
            layer.validate(i)?;
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
        }
        self.hidden.check()?;
        let ends = [("input", &self.input, self.layers[0].inputs)];
        let outputs = self.layers[self.layers.len() - 1].outputs;
        let mut ends = ends.into_iter().chain([("output", &self.output, outputs)]);
        ends.try_for_each(|(end, map, count)| {
            map.iter().try_for_each(|map| map.validate(end, count))
        })
    }
}
/// Whether a character controls, or is of no width: marks of direction and of format among them.
fn is_invisible(c: char) -> bool {
    let formats = [
        '\u{ad}', '\u{61c}', '\u{180e}', '\u{feff}', '\u{2028}', '\u{2029}', '\u{115f}', '\u{3164}',
    ];
    c.is_control()
        || formats.contains(&c)
        || ('\u{200b}'..='\u{200f}').contains(&c)
        || ('\u{202a}'..='\u{202e}').contains(&c)
        || ('\u{2060}'..='\u{206f}').contains(&c)
}
