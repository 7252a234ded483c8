//! Keys of a configuration: overriding them, and refusing unknown ones with the nearest valid.

use toml::{Table, Value};

use crate::error::{Error, Result};
use crate::formula::text::meant;

/// The document that `section.key=value` stands for; the value in TOML, or else a string.
pub(super) fn parse_assignment(text: &str) -> Result<Table> {
    let malformed = || {
        let problem = "expected section.key=value, for instance rollout.horizon=40";
        Error::invalid(format!("--set {text}"), problem)
    };
    let (path, value) = text.split_once('=').ok_or_else(malformed)?;
    let mut keys = path.split('.').map(str::trim);
    if keys.clone().any(str::is_empty) {
        return Err(malformed());
    }
    let first = keys.next().ok_or_else(malformed)?;
    if parse_value(value.trim()).as_table().is_some_and(Table::is_empty) {
        return Err(Error::invalid(format!("--set {text}"), "an empty table sets nothing"));
    }
    let inner = keys.rfold(parse_value(value.trim()), |inner, key| {
        Value::Table(Table::from_iter([(key.to_owned(), inner)]))
    });
    Ok(Table::from_iter([(first.to_owned(), inner)]))
}

/// `text` as a TOML value, or as a string where it is none.
fn parse_value(text: &str) -> Value {
    let document = toml::from_str::<Table>(&format!("value = {text}"));
    match document {
        // A line break could smuggle in further keys.
        Ok(mut table) if table.len() == 1 => table.remove("value"),
        _ => None,
    }
    .unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Edits that a slip of the fingers may make.
const SLIPS: usize = 2;

/// Keys that say which other keys a table has, and the keys that one of their values brings.
const TAGS: [(&str, &[&str]); 2] = [
    (
        "family",
        &[
            "position", "velocity", "lane", "speed", "control", "away", "wide", "last", "state",
            "obstacle",
        ],
    ),
    ("kind", &["time", "knots"]),
];

/// Lays `over` on `base`: tables key by key, everything else whole. A table that changes its kind
/// starts afresh, but for the keys that both kinds have as tables.
pub(super) fn overlay(base: &mut Table, over: Table) {
    for (tag, keys) in TAGS {
        if over.get(tag).is_some_and(|kind| base.contains_key(tag) && base.get(tag) != Some(kind)) {
            base.retain(|key, _| !keys.contains(&key));
        }
    }
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(base)), Value::Table(over)) => overlay(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// The keys of `defaults` and those that have no default.
pub(super) fn with_optional(defaults: &Table) -> Table {
    let mut valid = defaults.clone();
    valid.insert("attempt".to_owned(), Value::Integer(1));
    // Of a model, the description knows which keys its policy has.
    if !defaults.contains_key("model") {
        let policy = ["file", "formula"].map(|key| (key.to_owned(), Value::String(String::new())));
        valid.insert("policy".to_owned(), Value::Table(Table::from_iter(policy)));
    }
    if let Some(Value::Table(global)) = valid.get_mut("global") {
        for key in ["box_risk", "risk"] {
            global.insert(key.to_owned(), Value::Float(0.0));
        }
    }
    if let Some(Value::Table(plan)) = valid.get_mut("plan") {
        plan.insert("sigma".to_owned(), Value::Float(0.0));
        plan.insert("steps".to_owned(), Value::Integer(0));
    }
    with_states(&mut valid);
    with_tagged(&mut valid);
    valid
}

/// Adds the states to the tables of training that numbers of states may stand in, for a model as text.
fn with_states(valid: &mut Table) {
    let states = valid.get("box").cloned().filter(|_| valid.contains_key("model"));
    for path in [["ddpg", "disturbance"].as_slice(), &["ppo", "reward", "goal"]] {
        let train = valid.get_mut("train");
        let place = path.iter().try_fold(train, |table, key| table.map(|t| t.get_mut(key)));
        if let (Some(Some(place)), Some(states)) = (place, &states) {
            *place = states.clone();
        }
    }
}

/// Adds to each table with a tag the keys that another value of the tag would bring.
fn with_tagged(table: &mut Table) {
    for (tag, keys) in TAGS {
        if table.contains_key(tag) {
            for key in keys {
                table.entry(*key).or_insert(Value::Float(0.0));
            }
        }
    }
    table.iter_mut().filter_map(|(_, value)| value.as_table_mut()).for_each(with_tagged);
}

/// Refuses the first key of `given` that `valid` does not have.
pub(super) fn check_known(valid: &Table, given: &Table, origin: &str) -> Result<()> {
    check_level(valid, valid, given, "", origin)
}

/// [`check_known`] for the tables at `prefix`; `root` has all valid keys.
fn check_level(
    root: &Table,
    valid: &Table,
    given: &Table,
    prefix: &str,
    origin: &str,
) -> Result<()> {
    for (key, value) in given {
        let path = format!("{prefix}{key}");
        let refused = |problem: String| Err(Error::invalid(origin, problem));
        match (valid.get(key), value) {
            (None, _) => {
                let nearest = suggestion(root, valid, prefix, key);
                return refused(format!(
                    "unknown key `{path}`; the nearest valid key is `{nearest}`"
                ));
            }
            (Some(Value::Table(valid)), Value::Table(given)) => {
                check_level(root, valid, given, &format!("{path}."), origin)?;
            }
            (Some(Value::Table(_)), _) => {
                return refused(format!("`{path}` is a section, not a value"));
            }
            (Some(default), _) if of_one_kind(&path) && !same_kind(default, value) => {
                // A section that is read by its `name` does not say which key was wrong, nor a list
                // of words what was expected.
                let expected = default.type_str();
                return refused(format!("`{path}` is {value}, expected a {expected}"));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Refuses a number at or below the key `path` that is not finite as f32.
pub(super) fn check_finite(path: &str, value: &Value) -> Result<()> {
    match value {
        Value::Float(number) if !(*number as f32).is_finite() => {
            Err(Error::invalid(path, format!("{number} is not a finite number")))
        }
        Value::Array(list) => list.iter().try_for_each(|inner| check_finite(path, inner)),
        Value::Table(table) => {
            let below =
                |(key, inner): (&String, &Value)| check_finite(&format!("{path}.{key}"), inner);
            table.iter().try_for_each(below)
        }
        _ => Ok(()),
    }
}

/// Whether all values of the key `path` are of the kind of its default.
fn of_one_kind(path: &str) -> bool {
    path.starts_with("system.") || path.starts_with("deviation.") || path == "growth.boundary"
}

/// Whether `value` can stand where `default` stands; a whole number is a float too.
fn same_kind(default: &Value, value: &Value) -> bool {
    default.same_type(value) || (default.is_float() && value.is_integer())
}

/// The paths of all keys that are not sections, with dots.
fn paths(table: &Table, prefix: &str) -> Vec<String> {
    let path = |(key, value): (&String, &Value)| {
        let path = format!("{prefix}{key}");
        match value {
            Value::Table(inner) => paths(inner, &format!("{path}.")),
            _ => vec![path],
        }
    };
    table.iter().flat_map(path).collect()
}

/// The valid key that was most likely meant by `key`, which the section `valid` at `prefix` does not
/// have: a slip of the fingers, one of that name in another section, else the nearest of the section.
fn suggestion(root: &Table, valid: &Table, prefix: &str, key: &str) -> String {
    let siblings: Vec<String> = valid.keys().cloned().collect();
    if let Some(sibling) = close(key, &siblings) {
        return format!("{prefix}{sibling}");
    }
    let (path, all) = (format!("{prefix}{key}"), paths(root, ""));
    let namesakes = all.iter().filter(|path| path.rsplit('.').next() == Some(key));
    let namesakes: Vec<String> = namesakes.cloned().collect();
    match (namesakes.is_empty(), prefix.is_empty() || siblings.is_empty()) {
        (false, _) => nearest(&path, &namesakes).to_owned(),
        (true, true) => nearest(&path, &all).to_owned(),
        (true, false) => {
            let meant = meant(key, siblings.iter().map(String::as_str));
            format!("{prefix}{}", meant.unwrap_or_else(|| nearest(key, &siblings)))
        }
    }
}

/// The candidate that is a slip or two away from `key`, if there is one.
fn close<'a>(key: &str, candidates: &'a [String]) -> Option<&'a str> {
    let edits = |candidate: &&String| strsim::damerau_levenshtein(key, candidate);
    let nearest = candidates.iter().min_by_key(edits)?;
    (edits(&nearest) <= SLIPS.min(key.chars().count() / 2)).then_some(nearest)
}

/// The candidate that takes the fewest edits to get to; a key in the wrong section counts by its
/// last part alone, one edit dearer.
pub(super) fn nearest<'a>(path: &str, candidates: &'a [String]) -> &'a str {
    let last = |path: &str| path.rsplit('.').next().unwrap_or_default().to_owned();
    let edits = |candidate: &&String| {
        let whole = strsim::damerau_levenshtein(path, candidate);
        whole.min(1 + strsim::damerau_levenshtein(&last(path), &last(candidate)))
    };
    candidates.iter().min_by_key(edits).map_or("", String::as_str)
}
