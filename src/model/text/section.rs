//! A section of a description: its keys by type, and refusals that name them.

use toml::{Table, Value};

use super::origin::Origin;
use crate::error::{Error, Result};
use crate::formula::text::{LONGEST_NAME, nearest, shown};

/// A table at a dotted path.
#[derive(Clone, Debug)]
pub(super) struct Section<'a> {
    pub(super) origin: &'a Origin,
    pub(super) path: String,
    table: &'a Table,
}

impl<'a> Section<'a> {
    /// The whole document.
    pub(super) fn root(origin: &'a Origin, table: &'a Table) -> Self {
        Self { origin, path: String::new(), table }
    }

    /// The dotted path of `key`.
    pub(super) fn at(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// The refusal of what stands at `key`.
    pub(super) fn refuse(&self, key: &str, problem: impl Into<String>) -> Error {
        self.origin.refuse(&self.at(key), problem)
    }

    /// The refusal of the section as a whole.
    pub(super) fn refuse_whole(&self, problem: impl Into<String>) -> Error {
        self.origin.refuse(&self.path, problem)
    }

    /// Whether it has `key`.
    pub(super) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Refuses a key that is none of `keys`.
    pub(super) fn only<'b>(&self, keys: impl Iterator<Item = &'b str> + Clone) -> Result<()> {
        for key in self.table.keys() {
            if keys.clone().all(|known| known != key) {
                return Err(self.refuse(key, unknown("key", key, keys)));
            }
        }
        Ok(())
    }

    /// Bytes of all keys and texts in it.
    pub(super) fn length(&self) -> usize {
        length(self.table)
    }

    /// Keys and values in order of the text.
    pub(super) fn entries(&self) -> impl Iterator<Item = (&'a str, &'a Value)> + use<'a> {
        self.table.iter().map(|(key, value)| (key.as_str(), value))
    }

    /// The section `key`.
    pub(super) fn section(&self, key: &str) -> Result<Option<Self>> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        match value {
            Value::Table(table) => {
                Ok(Some(Self { origin: self.origin, path: self.at(key), table }))
            }
            other => Err(self.wrong(key, &self.expected_section(key, other), other)),
        }
    }

    /// What a section `key` would be that says `value`.
    fn expected_section(&self, key: &str, value: &Value) -> String {
        let inner = match (self.path.rsplit('.').next(), value) {
            (Some("parameters"), Value::Integer(_) | Value::Float(_)) => "value",
            (Some("states"), Value::Array(ends)) if ends.len() == 2 => "box",
            (Some("controls"), Value::Array(ends)) if ends.len() == 2 => "bounds",
            _ => return "a section".to_owned(),
        };
        format!("a section, `{key} = {{ {inner} = {value} }}`")
    }

    /// The section `key`, which `why` is needed.
    pub(super) fn required(&self, key: &str, why: &str) -> Result<Self> {
        let missing = || self.refuse(key, format!("missing; expected {why}"));
        self.section(key)?.ok_or_else(missing)
    }

    /// The text at `key`.
    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>> {
        self.value(key, "a text between quotes", Value::as_str)
    }

    /// The number at `key`.
    pub(super) fn number(&self, key: &str) -> Result<Option<f32>> {
        self.value(key, "a number", number)
    }

    /// The whole number at `key`.
    pub(super) fn whole(&self, key: &str) -> Result<Option<i64>> {
        self.value(key, "a whole number", Value::as_integer)
    }

    /// `true` or `false` at `key`.
    pub(super) fn flag(&self, key: &str) -> Result<Option<bool>> {
        self.value(key, "true or false", Value::as_bool)
    }

    /// The interval at `key`: lower end, upper end.
    pub(super) fn interval(&self, key: &str) -> Result<Option<[f32; 2]>> {
        let Some([low, high]) =
            self.value(key, "a list of two numbers, the lower and the upper end", pair)?
        else {
            return Ok(None);
        };
        if low > high {
            let problem =
                format!("turned round: [{low}, {high}] has its lower end above its upper");
            return Err(self.refuse(key, problem));
        }
        if low.is_nan() || high.is_nan() {
            return Err(self.refuse(key, format!("[{low}, {high}] has an end that is no number")));
        }
        Ok(Some([low, high]))
    }

    /// The point at `key`.
    pub(super) fn point(&self, key: &str) -> Result<Option<[f32; 2]>> {
        self.value(key, "a list of two numbers", pair)
    }

    /// Refuses more than `most` entries, which are called `what`.
    pub(super) fn at_most(&self, what: &str, most: usize) -> Result<()> {
        let count = self.table.len();
        match count <= most {
            true => Ok(()),
            false => Err(self.refuse_whole(format!("{count} {what}, expected at most {most}"))),
        }
    }

    /// The list of `N` finite numbers at `key`.
    pub(super) fn numbers<const N: usize>(
        &self,
        key: &str,
        expected: &str,
    ) -> Result<Option<[f32; N]>> {
        self.value(key, expected, |value| {
            let list = value.as_array()?.iter().map(number).collect::<Option<Vec<f32>>>()?;
            <[f32; N]>::try_from(list).ok().filter(|list| list.iter().all(|x| x.is_finite()))
        })
    }

    /// The list of values at `key`.
    pub(super) fn list(&self, key: &str, expected: &str) -> Result<Option<&'a [Value]>> {
        self.value(key, expected, |value| value.as_array().map(Vec::as_slice))
    }

    /// The value at `key` as `read` takes it, which is what is `expected`.
    fn value<T>(
        &self,
        key: &str,
        expected: &str,
        read: impl Fn(&'a Value) -> Option<T>,
    ) -> Result<Option<T>> {
        let Some(value) = self.table.get(key) else { return Ok(None) };
        read(value).map(Some).ok_or_else(|| self.wrong(key, expected, value))
    }

    /// The value at `key` as it was written.
    pub(super) fn written(&self, key: &str) -> String {
        self.table.get(key).map_or_else(String::new, written)
    }

    /// The refusal of a value of the wrong kind.
    pub(super) fn wrong(&self, key: &str, expected: &str, found: &Value) -> Error {
        self.refuse(key, format!("expected {expected}, found {}", words(found)))
    }
}

/// The refusal of the `kind` of thing called `name`, which is none of `known`.
pub(super) fn unknown<'a>(kind: &str, name: &str, known: impl Iterator<Item = &'a str>) -> String {
    // The time to find the nearest grows with the length.
    let near = if name.len() > LONGEST_NAME { None } else { nearest(name, known) };
    let near = near.map(|near| format!("; the nearest is `{near}`")).unwrap_or_default();
    format!("unknown {kind} `{}`{near}", shown(name))
}

/// Bytes of all keys and texts in `table`.
fn length(table: &Table) -> usize {
    let of = |value: &Value| match value {
        Value::String(text) => text.len(),
        Value::Array(list) => list.iter().filter_map(Value::as_str).map(str::len).sum(),
        Value::Table(inner) => length(inner),
        _ => 0,
    };
    table.iter().map(|(key, value)| key.len() + of(value)).sum()
}

/// A number, whole or not, rounded to f32.
fn number(value: &Value) -> Option<f32> {
    match value {
        Value::Float(number) => Some(*number as f32),
        Value::Integer(number) => Some(*number as f32),
        _ => None,
    }
}

/// A value as it was written, a large or small number with its exponent.
fn written(value: &Value) -> String {
    match value {
        Value::Float(number) => format!("{number:?}"),
        Value::Array(list) => {
            format!("[{}]", list.iter().map(written).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// A list of two numbers.
fn pair(value: &Value) -> Option<[f32; 2]> {
    let [low, high] = value.as_array()?.as_slice() else { return None };
    Some([number(low)?, number(high)?])
}

/// What a value is, for an error.
fn words(value: &Value) -> String {
    match value {
        Value::String(text) => format!("the text \"{}\"", shown(text)),
        Value::Integer(number) => format!("the number {number}"),
        Value::Float(number) => format!("the number {number}"),
        Value::Boolean(flag) => format!("{flag}"),
        Value::Datetime(date) => format!("the date {date}"),
        Value::Array(list) => match list.iter().find(|one| number(one).is_none()) {
            Some(other) if !other.is_array() => {
                format!("a list of {} with {}", list.len(), words(other))
            }
            _ => format!("a list of {}", list.len()),
        },
        Value::Table(_) => "a section".to_owned(),
    }
}
