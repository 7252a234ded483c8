//! Spaces of Gymnasium as stable-baselines3 keeps them: pickled, in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::kind::{Cast, FloatReader};
use super::pickle;
use super::value::{Pickle, Place, Value};

/// The lower and the upper limits of a box, if that is what `text` holds.
pub(super) fn limits(text: &str) -> Option<[Vec<f64>; 2]> {
    let bytes = STANDARD.decode(text).ok()?;
    let unpickled = pickle::read(&bytes).ok()?;
    let Value::Object(number) = unpickled.root else { return None };
    let space = &unpickled.pickle.objects[number];
    if space.maker.name != "Box" {
        return None;
    }
    let states = space.parts.iter().filter_map(|part| match part {
        Value::Dict(dict) => Some(&unpickled.pickle.dicts[*dict]),
        _ => None,
    });
    let entries: Vec<&(Value<'_>, Value<'_>)> = states.flatten().collect();
    let array = |key: &str| {
        let found = entries.iter().rev().find(|(name, _)| *name == Value::Text(key))?;
        numbers(&unpickled.pickle, found.1)
    };
    let (low, high) = (array("low")?, array("high")?);
    (low.len() == high.len()).then_some([low, high])
}

/// The numbers of an array, the last index the fastest.
fn numbers(pickle: &Pickle<'_>, value: Value<'_>) -> Option<Vec<f64>> {
    let Value::Tensor(number) = value else { return None };
    let view = &pickle.tensors[number];
    let Place::Bytes(run) = view.storage.place else { return None };
    let FloatReader { size, number } = view.storage.kind.reader(Cast::ToF32).ok()?;
    let all: Vec<f64> = pickle.bytes[run].chunks_exact(size).map(number).collect();
    let is_whole = view.offset == 0 && view.shape.iter().product::<usize>() == all.len();
    (is_whole && view.is_in_rows()).then_some(all)
}
