//! From a pickle to named tensors: its dictionaries walked through, with the keys on the way.

use std::collections::HashSet;

use super::pickle::Unpickled;
use super::said;
use super::source::{Amount, Place, Plain, Said, Source, Tensor, Unmade};
use super::value::{self, Object, Pickle, Value, View};

/// How deep dictionaries may lie in one another.
const DEEPEST: usize = 16;
/// Most entries of all dictionaries, counted as often as they are reached.
const MOST_ENTRIES: usize = 1 << 17;
/// Longest key of a dictionary, bytes.
const LONGEST_KEY: usize = 256;
/// Classes whose attributes are tensors, or hold them.
const HOLDERS: [&str; 3] = ["RunningStatisticsState", "NestedMeanStd", "FrozenDict"];

/// The tensors of a pickle, and the objects that it would have had made.
///
/// # Errors
/// A sentence about a pickle that is one object, holds two tensors of one name, or is without end.
pub(super) fn source<'a>(unpickled: Unpickled<'_>) -> Result<Source<'a>, String> {
    let Unpickled { pickle, root, .. } = unpickled;
    refuse_object(&pickle, root)?;
    let mut walk = Walk { pickle: &pickle, seen: 0, dict: usize::MAX, found: Source::default() };
    walk.value(root, &mut Vec::new())?;
    let mut found = walk.found;
    let mut names = HashSet::new();
    if let Some(twice) = found.tensors.iter().find(|tensor| !names.insert(tensor.name.clone())) {
        return Err(format!("two tensors are called `{}`", twice.name));
    }
    found.runs = pickle.bytes;
    Ok(found)
}

/// Refuses a pickle that is a single thing, and no container of tensors.
fn refuse_object(pickle: &Pickle<'_>, root: Value<'_>) -> Result<(), String> {
    let maker = match root {
        Value::Dict(_) | Value::Tuple(_) | Value::List(_) => return Ok(()),
        Value::Object(number) if holds(&pickle.objects[number]) => return Ok(()),
        Value::Object(number) => pickle.objects[number].maker,
        Value::Name(name) => name,
        _ => {
            return Err(
                "no dictionary of tensors; save one: torch.save(module.state_dict(), FILE)"
                    .to_owned(),
            );
        }
    };
    if maker.name == "VecNormalize" {
        return Err(format!(
            "an object of `{maker}`: the statistics of observations, and no network; nothing was executed. Import \
             the model's own archive, and normalise what it is given"
        ));
    }
    Err(format!(
        "an object of `{maker}`, which a program would have to make; nothing was executed. Save tensors \
         alone: torch.save(module.state_dict(), FILE)"
    ))
}

/// Whether the attributes of an object are looked at.
fn holds(object: &Object<'_>) -> bool {
    // Modules of TorchScript, whose classes are all compiled.
    object.maker.module.starts_with("__torch__") || HOLDERS.contains(&object.maker.name)
}

/// A walk through the containers of a pickle.
struct Walk<'p, 'b, 'a> {
    pickle: &'p Pickle<'b>,
    /// Entries seen.
    seen: usize,
    /// The dictionary that is walked through; no number of one where the root is none.
    dict: usize,
    found: Source<'a>,
}

impl<'b> Walk<'_, 'b, '_> {
    /// Adds what is in `value`, which lies at `path`.
    fn value(&mut self, value: Value<'b>, path: &mut Vec<String>) -> Result<(), String> {
        let pickle = self.pickle;
        match value {
            Value::Tensor(number) => {
                let tensor = tensor(path.join("."), self.dict, &pickle.tensors[number]);
                self.found.tensors.push(tensor);
                Ok(())
            }
            Value::Dict(number) => self.entries(number, path),
            Value::List(number) => self.items(&pickle.lists[number], path),
            Value::Tuple(number) => self.items(&pickle.tuples[number], path),
            Value::Object(number) if holds(&pickle.objects[number]) && self.is_plain(number) => {
                let parts = pickle.objects[number].parts.iter();
                let dicts = parts.filter(|part| matches!(part, Value::Dict(_)));
                dicts.copied().try_for_each(|part| self.value(part, path))
            }
            Value::Object(number) => {
                let (name, maker) = (path.join("."), pickle.objects[number].maker.to_string());
                self.found.unmade.push(Unmade { name, dict: self.dict, maker });
                Ok(())
            }
            Value::Name(name) if name.module.starts_with("torch.nn") => {
                self.say(name.name.to_owned(), path);
                Ok(())
            }
            Value::Name(name) => {
                let (path, maker) = (path.join("."), name.to_string());
                self.found.unmade.push(Unmade { name: path, dict: self.dict, maker });
                Ok(())
            }
            _ => {
                if let Value::Truth(flag) = value {
                    self.found.flags.insert(path.join("."), flag);
                }
                match (amount(value), value) {
                    (Some(amount), _) => self.count(amount, path),
                    (_, Value::Text(text)) => self.say(text.to_owned(), path),
                    (_, Value::Type(_)) => self.say(String::new(), path),
                    _ => {}
                }
                Ok(())
            }
        }
    }

    /// Adds numbers that are no tensor.
    fn count(&mut self, amount: Amount, path: &[String]) {
        self.found.plain.push(Plain { name: path.join("."), amount });
    }

    /// Adds words.
    fn say(&mut self, text: String, path: &[String]) {
        self.found.said.push(Said { name: path.join("."), text });
    }

    /// Whether all that an object is made of are its attributes.
    fn is_plain(&self, object: usize) -> bool {
        self.pickle.objects[object].parts.iter().all(|part| match part {
            Value::Dict(_) | Value::Other => true,
            Value::Tuple(number) => self.pickle.tuples[*number].is_empty(),
            _ => false,
        })
    }

    /// Adds what is in a dictionary.
    fn entries(&mut self, dict: usize, path: &mut Vec<String>) -> Result<(), String> {
        let outer = std::mem::replace(&mut self.dict, dict);
        for &(key, value) in &self.pickle.dicts[dict] {
            let key = match key {
                Value::Text(text) if text.len() > LONGEST_KEY => {
                    return Err(format!("a key of {} bytes", text.len()));
                }
                // Haiku joins the names of modules so.
                Value::Text(text) => text.replace('/', "."),
                Value::Int(number) => number.to_string(),
                _ => "?".to_owned(),
            };
            self.within(key, value, path)?;
        }
        self.dict = outer;
        Ok(())
    }

    /// Adds what is in a list or a tuple.
    fn items(&mut self, items: &[Value<'b>], path: &mut Vec<String>) -> Result<(), String> {
        if !items.is_empty() && items.iter().all(|item| amount(*item).is_some()) {
            self.count(Amount::of(items.len()), path);
            return Ok(());
        }
        let word = |item: &Value<'b>| if let Value::Text(text) = item { Some(*text) } else { None };
        if let Some(words) = items.iter().map(word).collect::<Option<Vec<&str>>>()
            && !words.is_empty()
        {
            self.say(words.join(", "), path);
            return Ok(());
        }
        if let [weight, bias] = items
            && self.is_layer(*weight, *bias)
        {
            self.within("w".to_owned(), *weight, path)?;
            return self.within("b".to_owned(), *bias, path);
        }
        let mut numbered = items.iter().enumerate();
        numbered.try_for_each(|(i, item)| self.within(i.to_string(), *item, path))
    }

    /// Whether two values are a weight `[inputs, outputs]` and its bias, as programs over arrays keep them in pairs.
    fn is_layer(&self, weight: Value<'_>, bias: Value<'_>) -> bool {
        let (Value::Tensor(weight), Value::Tensor(bias)) = (weight, bias) else { return false };
        let [weight, bias] = [weight, bias].map(|number| &self.pickle.tensors[number]);
        let of_arrays = matches!(weight.storage.place, value::Place::Bytes(_));
        let fits = matches!((&weight.shape[..], &bias.shape[..]), ([_, outputs], [count]) if outputs == count);
        of_arrays && fits
    }

    /// Adds what lies under `key`.
    fn within(
        &mut self,
        key: String,
        value: Value<'b>,
        path: &mut Vec<String>,
    ) -> Result<(), String> {
        self.seen += 1;
        if self.seen > MOST_ENTRIES {
            return Err(format!("more than {MOST_ENTRIES} entries in its dictionaries"));
        }
        if path.len() == DEEPEST {
            return Err(format!("dictionaries within one another, {DEEPEST} deep and more"));
        }
        path.push(key);
        self.value(value, path)?;
        path.pop();
        Ok(())
    }
}

/// How many numbers a value is that is no tensor and holds none; none if it is no number.
fn amount(value: Value<'_>) -> Option<Amount> {
    match value {
        Value::Int(_) | Value::Long | Value::Float | Value::Truth(_) => Some(Amount::One),
        Value::Bytes(_) | Value::Storage(_) => Some(Amount::Many),
        Value::Text(text) => said::amount(text),
        _ => None,
    }
}

/// The tensor `name`.
pub(super) fn tensor(name: String, dict: usize, view: &View<'_>) -> Tensor {
    let View { storage, offset, shape, strides } = view.clone();
    let place = match storage.place {
        value::Place::Entry(key) => Place::Entry(key.to_owned()),
        value::Place::Bytes(number) => Place::Run(number),
    };
    Tensor { name, dict, shape, strides, offset, kind: storage.kind, place }
}
