//! Open bounds of a description in JSON, which has no word for infinity: as in
//! [`crate::files::number`].

use serde_json::Value as Json;
use toml::{Table, Value};

use crate::files::number::{of_word, word};

/// The ends of the bounds of all controls of `model`.
fn ends(model: &mut Table) -> impl Iterator<Item = &mut Value> {
    let controls = model.get_mut("controls").and_then(Value::as_table_mut).into_iter();
    let entries = controls.flatten().filter_map(|(_, entry)| entry.as_table_mut());
    let bounds = entries.filter_map(|entry| entry.get_mut("bounds")?.as_array_mut());
    bounds.flatten()
}

/// Puts words in the place of open ends.
pub(super) fn to_words(model: &mut Table) {
    for end in ends(model) {
        if let Some(word) = end.as_float().and_then(word) {
            *end = Value::String(word.to_owned());
        }
    }
}

/// Puts open ends in the place of their words.
pub(super) fn of_words(model: &mut Table) {
    for end in ends(model) {
        if let Some(number) = end.as_str().and_then(of_word) {
            *end = Value::Float(number);
        }
    }
}

/// Puts words in the place of the `null` that older documents have for open ends.
pub(super) fn of_nulls(config: &mut Json) {
    let controls = config.pointer_mut("/model/controls").and_then(Json::as_object_mut);
    let entries = controls.into_iter().flatten().map(|(_, entry)| entry);
    for bounds in entries.filter_map(|entry| entry.get_mut("bounds")?.as_array_mut()) {
        for (end, word) in bounds.iter_mut().zip(["-inf", "inf"]) {
            if end.is_null() {
                *end = Json::from(word);
            }
        }
    }
}
