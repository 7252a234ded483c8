//! Spaces of Gymnasium as stable-baselines3 keeps them: pickled, in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::collect;
use super::kind::Cast;
use super::pickle;
use super::source::Source;
use super::value::Value;

/// The lower and the upper limits of a box, if that is what `text` holds.
pub(super) fn limits(text: &str) -> Option<[Vec<f64>; 2]> {
    let bytes = STANDARD.decode(text).ok()?;
    let unpickled = pickle::read(&bytes).ok()?;
    let (pickle, Value::Object(number)) = (unpickled.pickle, unpickled.root) else { return None };
    let space = &pickle.objects[number];
    if space.maker.name != "Box" {
        return None;
    }
    let states = space.parts.iter().filter_map(|part| match part {
        Value::Dict(dict) => Some(&pickle.dicts[*dict]),
        _ => None,
    });
    let entries: Vec<&(Value<'_>, Value<'_>)> = states.flatten().collect();
    let array = |key: &str| {
        let found = entries.iter().rev().find(|(name, _)| *name == Value::Text(key))?;
        let Value::Tensor(number) = found.1 else { return None };
        Some(collect::tensor(key.to_owned(), 0, &pickle.tensors[number]))
    };
    let [low, high] = [array("low")?, array("high")?];
    let mut source = Source { runs: pickle.bytes, ..Source::default() };
    let mut numbers = |tensor| source.numbers(tensor, Cast::ToF32).ok();
    let [low, high] = [numbers(&low)?, numbers(&high)?];
    (low.len() == high.len()).then_some([low, high])
}
