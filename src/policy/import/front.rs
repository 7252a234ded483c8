//! What becomes of maps before the first layer, where the digits of numbers far from 0 are still there to be kept,
//! and of cuts: as maps, and as activations.

use super::linear::{Chosen, Linear};
use super::map::Map;
use crate::policy::Activation;

/// Summand of an input from which on a sum of products loses more than a millionth.
pub(super) const FAR: f64 = 4.0;
/// The same times the largest weight behind it.
pub(super) const STEEP: f64 = 100.0;

/// A choice of the inputs, with what it and a map behind it do to each, in front of the choice.
pub(super) struct Moved {
    /// Of the inputs.
    pub(super) front: Map,
    /// Which of them, each with what is left for it to do.
    pub(super) choice: Linear,
    /// What is left of a map with limits.
    pub(super) rest: Option<Map>,
    /// Whether something is added that loses digits.
    pub(super) is_far: bool,
}

impl Moved {
    /// `map` behind `choice`: whole, or, where an input is chosen more than once and mapped in several ways, what
    /// brings it near 0.
    pub(super) fn of(choice: &Linear, map: &Map) -> Self {
        let Chosen { places, map: own } = choice.chosen();
        let (map, inputs) = (own.then(map), choice.inputs);
        let pairs = || map.shift.iter().zip(&map.scale);
        let is_far = pairs().any(|(shift, scale)| shift.abs() > FAR && *scale != 0.0);
        let mut choice = Linear::selection(&places, inputs);
        let front = map.scattered(&places, inputs);
        if front.selected(&places) == map {
            return Self { front, choice, rest: None, is_far };
        }
        let front = Map::affine(vec![1.0; inputs], centers(&map, &places, inputs));
        let back = |(i, &place): (usize, &usize)| map.shift[i] - map.scale[i] * front.shift[place];
        let shift = places.iter().enumerate().map(back).collect();
        let rest = Map { shift, ..map };
        // It has the widths of the choice.
        let is_affine = rest.is_affine() && choice.scaled(&rest).is_ok();
        Self { front, choice, rest: Some(rest).filter(|_| !is_affine), is_far }
    }
}

/// What brings each of the inputs near 0 where `map` of those at `places` does: of the last of these.
fn centers(map: &Map, places: &[usize], inputs: usize) -> Vec<f64> {
    let mut shift = vec![0.0; inputs];
    for (i, &place) in places.iter().enumerate() {
        let zero = -map.shift[i] / map.scale[i];
        if map.shift[i].abs() > FAR && f64::is_finite(zero) {
            shift[place] = -zero;
        }
    }
    shift
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

/// The activation that cuts off at these limits.
pub(super) fn clip([low, high]: [f64; 2]) -> Result<Activation, String> {
    match (low, high) {
        (f64::NEG_INFINITY, f64::INFINITY) => Ok(Activation::Identity),
        (0.0, f64::INFINITY) => Ok(Activation::Relu),
        (0.0, 6.0) => Ok(Activation::Relu6),
        _ if low.is_finite() && high.is_finite() && low < high => {
            Ok(Activation::Hardtanh { low: low as f32, high: high as f32 })
        }
        _ => Err(format!("a clip from {low} to {high} between layers")),
    }
}

/// The activation that `activation`, which cuts off, and `map` behind it are, if that cuts off and does no more.
pub(super) fn cut_again(activation: Activation, map: &Map) -> Option<Activation> {
    let first = cut(activation, map.width())?;
    let (affine, limits) = first.then(map).parts();
    limits.filter(|_| affine.is_identity()).and_then(|limits| clip(limits).ok())
}
