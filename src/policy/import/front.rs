//! What becomes of maps before the first layer, where the digits of numbers far from 0 are still there to be kept.

use super::map::Map;
use crate::policy::Activation;

/// Summand of an input from which on a sum of products loses more than a millionth.
pub(super) const FAR: f64 = 4.0;

/// A map behind a part of the inputs, as one of all inputs and what is left of it.
pub(super) struct Moved {
    /// Of the inputs.
    pub(super) front: Map,
    /// Of the part, if anything is left.
    pub(super) rest: Option<Map>,
}

/// The map that cuts off as `activation` does, of `width` numbers, if that is all it does.
pub(super) fn cut(activation: Activation, width: usize) -> Option<Map> {
    let [low, high] = match activation {
        Activation::Relu => [0.0, f64::INFINITY],
        Activation::Relu6 => [0.0, 6.0],
        Activation::Hardtanh { low, high } => [low, high].map(f64::from),
        _ => return None,
    };
    Some(Map::clamp(vec![low; width], vec![high; width]))
}

/// `map` of the inputs at `places` of `inputs`, moved in front of the choice: whole, or, where an input is chosen more
/// than once and mapped in several ways, what brings it near 0.
pub(super) fn moved(map: &Map, places: &[usize], inputs: usize) -> Moved {
    let front = map.scattered(places, inputs);
    if front.selected(places) == *map {
        return Moved { front, rest: None };
    }
    let mut shift = vec![0.0; inputs];
    for (i, &place) in places.iter().enumerate() {
        let zero = -map.shift[i] / map.scale[i];
        if map.shift[i].abs() > FAR && f64::is_finite(zero) {
            shift[place] = -zero;
        }
    }
    let front = Map::affine(vec![1.0; inputs], shift);
    let back = |(i, &place): (usize, &usize)| map.shift[i] - map.scale[i] * front.shift[place];
    let shift = places.iter().enumerate().map(back).collect();
    Moved { rest: Some(Map { shift, ..map.clone() }), front }
}
