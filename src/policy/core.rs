//! A network without the maps at its ends, which are formulas to whoever runs it.

use std::sync::Arc;

use super::{Activation, Layer, Mlp, Rescale};

/// A network taken apart: what its inputs go through, its layers, and what its outputs go through.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    /// Before the layers, where anything is.
    pub(crate) input: Option<Rescale>,
    /// The layers.
    pub(crate) core: Arc<Mlp>,
    /// Behind the layers, where anything is.
    pub(crate) output: Option<Rescale>,
}

/// The ends of a layer that factors can be moved to.
#[derive(Clone, Copy)]
enum End {
    Inputs,
    Outputs,
}

impl Mlp {
    /// Whether it has a map at an end.
    pub(crate) fn is_mapped(&self) -> bool {
        self.input_map().is_some() || self.output_map().is_some()
    }

    /// Its layers by themselves, and the maps that are left to be formulas.
    ///
    /// A map that only multiplies is moved into the layer beside it where every product with a weight is an f32
    /// number: then each neuron has the same bits as before, wherever nothing over- or underflows. Any other map would
    /// have to be rounded, so it stays.
    pub(crate) fn parts(&self) -> Parts {
        let mut layers = self.layers().to_vec();
        let left = |map: Option<&Rescale>, layer: Option<&mut Layer>, end| {
            let map = map?;
            let folded = layer.as_ref().and_then(|layer| folded(map, layer, end));
            match (folded, layer) {
                (Some(folded), Some(layer)) => {
                    *layer = folded;
                    None
                }
                _ => Some(map.clone()),
            }
        };
        let input = left(self.input_map(), layers.first_mut(), End::Inputs);
        let output = left(self.output_map(), layers.last_mut(), End::Outputs);
        Parts { input, core: Arc::new(self.of_layers(layers)), output }
    }
}

/// `layer` with the factors of `map` in its weights; none where that is not exact.
fn folded(map: &Rescale, layer: &Layer, end: End) -> Option<Layer> {
    let unmoved = map.shift.iter().all(|shift| *shift == 0.0) && !map.is_centered();
    let plain = map.is_affine() && unmoved;
    let bare = layer.norm.is_none() && layer.activation == Activation::Identity;
    if !plain || (matches!(end, End::Outputs) && !bare) {
        return None;
    }
    let factor = |at: usize| match end {
        End::Inputs => map.scale[at % layer.inputs],
        End::Outputs => map.scale[at / layer.inputs],
    };
    let weights = layer.weight.iter().enumerate();
    let weight = weights.map(|(at, weight)| exact(factor(at), *weight)).collect::<Option<_>>()?;
    let bias = match end {
        End::Inputs => layer.bias.clone(),
        End::Outputs => {
            let biases = layer.bias.iter().zip(&map.scale);
            biases.map(|(bias, scale)| exact(*scale, *bias)).collect::<Option<_>>()?
        }
    };
    Some(Layer { weight, bias, ..layer.clone() })
}

/// The product of a power of two and a number, if it is an f32 of the usual precision.
fn exact(factor: f32, number: f32) -> Option<f32> {
    let product = factor * number;
    let power = factor.is_normal() && factor.to_bits().trailing_zeros() >= 23;
    (power && (number == 0.0 || product.is_normal())).then_some(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(scale: f32, shift: f32) -> Mlp {
        let layers =
            vec![Layer::dense(vec![0.3, -1.7], vec![0.1]), Layer::dense(vec![2.3], vec![0.7])];
        let mlp = Mlp::new(layers, Activation::Tanh, Activation::Identity).expect("a network");
        let mlp = mlp.with_input(Rescale::affine(vec![scale, 1.0], vec![shift, 0.0]));
        let output = Rescale::affine(vec![scale], vec![shift]);
        mlp.and_then(|mlp| mlp.with_output(output)).expect("maps")
    }

    #[test]
    fn powers_of_two_are_moved_into_the_layers_and_nothing_else_is() {
        let mlp = network(0.25, 0.0);
        let Parts { input: None, core, output: None } = mlp.parts() else {
            panic!("both are exact")
        };
        for x in [[0.3_f32, -7.0], [1e3, 0.1], [-0.2, 0.9]] {
            assert_eq!(core.forward(&x)[0].to_bits(), mlp.forward(&x)[0].to_bits());
        }
        for mlp in [network(0.3, 0.0), network(0.25, 1.0)] {
            let Parts { input: Some(_), core, output: Some(_) } = mlp.parts() else {
                panic!("neither is exact")
            };
            assert_eq!(core.layers(), mlp.layers());
        }
        let clipped = Rescale { high: vec![1.0; 2], ..Rescale::affine(vec![0.5; 2], vec![0.0; 2]) };
        let mlp = network(0.25, 0.0).with_input(clipped).expect("a map");
        assert!(mlp.parts().input.is_some(), "a clip is no factor");
        assert_eq!(exact(0.5, f32::MIN_POSITIVE), None, "less precise");
    }
}
