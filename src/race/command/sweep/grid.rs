//! The grid of a sweep: axes from options, their points, and what each value sets.

use crate::config::Overrides;
use crate::error::{Error, Result};
use crate::race::command::input::name;
use crate::race::controller::Name;
use crate::race::sweep::record::AxisRecord;

/// Most points of a grid: more is a slip.
const MOST_POINTS: u64 = 10_000;

/// What a value of an axis is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A whole number.
    Whole,
    /// A number.
    Number,
    /// A number, or a list of numbers in brackets.
    Numbers,
    /// `independent`, `colored:TIME` or `spline:KNOTS`.
    Noise,
    /// Any value of a configuration.
    Any,
    /// One of these words.
    Word(&'static [&'static str]),
}

/// What a value of an axis changes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target {
    /// The controller.
    Controller,
    /// This key in every section of plans of the controller.
    Plan(&'static str),
    /// These keys of the configuration.
    Keys(Vec<String>),
    /// The deviation bound.
    Bound,
    /// How scenarios are counted.
    Count,
}

/// One parameter and the values that it takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// The option that asked for it.
    pub(super) option: String,
    pub(super) name: String,
    pub(super) target: Target,
    pub(super) values: Vec<String>,
}

impl Axis {
    /// The axis that `option` asks for with the list `text`.
    pub(super) fn new(
        option: &str,
        name: &str,
        target: Target,
        kind: Kind,
        text: &str,
    ) -> Result<Self> {
        let values: Vec<String> = split(text).into_iter().map(str::to_owned).collect();
        if values.is_empty() {
            let problem = format!("no value; give a list, for instance {}", kind.example());
            return Err(Error::invalid(option, problem));
        }
        for (i, value) in values.iter().enumerate() {
            kind.check(value).map_err(|expected| {
                let problem = format!(
                    "`{value}` is not {expected}; give a list, for instance {}",
                    kind.example()
                );
                Error::invalid(option, problem)
            })?;
            if values[..i].contains(value) {
                return Err(Error::invalid(option, format!("`{value}` is there twice")));
            }
        }
        Ok(Self { option: option.to_owned(), name: name.to_owned(), target, values })
    }

    /// What `value` sets, as `--set` takes it, for `controller`.
    pub(super) fn assignments(&self, value: &str, controller: Option<Name>) -> Vec<String> {
        match &self.target {
            Target::Plan(key) => {
                let sections = controller.map_or(&[][..], Name::plan_sections);
                sections.iter().map(|section| assignment(section, key, value)).collect()
            }
            Target::Keys(keys) => keys.iter().map(|key| format!("{key}={value}")).collect(),
            Target::Bound if value == "exact" => vec!["deviation.source=\"exact\"".to_owned()],
            Target::Bound => vec![
                "deviation.source=\"scenario\"".to_owned(),
                format!("deviation.joint=\"{value}\""),
            ],
            Target::Controller | Target::Count => Vec::new(),
        }
    }
}

/// `section.key=value`, where a noise becomes the table that the configuration has.
fn assignment(section: &str, key: &str, value: &str) -> String {
    let value = match (key, value.split_once(':')) {
        ("noise", Some(("colored", time))) => format!("{{ kind = \"colored\", time = {time} }}"),
        ("noise", Some(("spline", knots))) => format!("{{ kind = \"spline\", knots = {knots} }}"),
        ("noise", _) => format!("{{ kind = \"{value}\" }}"),
        _ => value.to_owned(),
    };
    format!("{section}.{key}={value}")
}

impl Kind {
    /// What was expected if `value` is not of this kind.
    fn check(self, value: &str) -> std::result::Result<(), String> {
        let number = |text: &str| text.trim().parse::<f64>().is_ok_and(f64::is_finite);
        let expected = |fits: bool, expected: &str| match fits {
            true => Ok(()),
            false => Err(expected.to_owned()),
        };
        match self {
            Self::Whole => expected(value.parse::<u32>().is_ok(), "a whole number"),
            Self::Number => expected(number(value), "a number"),
            Self::Numbers => {
                let inner = value.replace(['[', ']'], "");
                expected(inner.split(',').all(number), "a number or a list of numbers in brackets")
            }
            Self::Noise => {
                let fits = match value.split_once(':') {
                    Some(("colored", time)) => number(time),
                    Some(("spline", knots)) => knots.parse::<u32>().is_ok(),
                    _ => value == "independent",
                };
                expected(fits, "`independent`, `colored:TIME` or `spline:KNOTS`")
            }
            Self::Any => Ok(()),
            Self::Word(words) => {
                let words_text = format!("one of {}", words.join(", "));
                expected(words.contains(&value), &words_text)
            }
        }
    }

    /// A list of such values.
    fn example(self) -> String {
        match self {
            Self::Whole => "64,256,1024".to_owned(),
            Self::Number => "0.1,1,10".to_owned(),
            Self::Numbers => "0.2,0.4,[0.2,0.4,0.4]".to_owned(),
            Self::Noise => "independent,colored:3,spline:5".to_owned(),
            Self::Any => "0.5,1,2".to_owned(),
            Self::Word(words) => words.join(","),
        }
    }
}

/// The parts of a list: at commas that are not inside brackets, braces or quotes; none where the
/// whole list is blank.
fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut quoted, mut first, mut parts) = (0, false, 0, Vec::new());
    for (at, letter) in text.char_indices() {
        match letter {
            '"' | '\'' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 => {
                parts.push(&text[first..at]);
                first = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[first..]);
    parts.into_iter().map(str::trim).filter(|part| !part.is_empty()).collect()
}

/// The axis of `--vary KEY=V1,V2,...`.
pub(super) fn varied(text: &str) -> Result<Axis> {
    let option = format!("--vary {text}");
    let problem = "expected section.key=V1,V2,..., for instance race.mppi.cost.speed=0.5,1,2";
    let (key, values) =
        text.split_once('=').ok_or_else(|| Error::invalid(option.as_str(), problem))?;
    let key = key.trim();
    Axis::new(&option, key, Target::Keys(vec![key.to_owned()]), Kind::Any, values)
}

/// The axes of a sweep.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub(super) axes: Vec<Axis>,
}

/// One point: a value of each axis.
pub(super) type Values = Vec<String>;

impl Grid {
    /// The grid of `axes`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if nothing varies (`hint` says what could), an axis is there twice, or
    /// there are too many points.
    pub(super) fn new(axes: Vec<Axis>, hint: &str) -> Result<Self> {
        if axes.iter().all(|axis| axis.target == Target::Controller && axis.values.len() == 1) {
            return Err(Error::invalid("sweep", format!("nothing varies; give {hint}")));
        }
        for (i, axis) in axes.iter().enumerate() {
            if let Some(other) = axes[..i].iter().find(|other| other.name == axis.name) {
                let problem = format!("`{}` is an axis of {} already", axis.name, other.option);
                return Err(Error::invalid(axis.option.as_str(), problem));
            }
        }
        let sizes = axes.iter().map(|axis| axis.values.len() as u64);
        let total = sizes.fold(1_u64, u64::saturating_mul);
        if total > MOST_POINTS {
            let problem = format!("{total} points, at most {MOST_POINTS}; give fewer values");
            return Err(Error::invalid("sweep", problem));
        }
        Ok(Self { axes })
    }

    /// Every point, the last axis fastest.
    pub(super) fn points(&self) -> Vec<Values> {
        let mut points = vec![Vec::new()];
        for axis in &self.axes {
            let extended = |point: &Values| {
                let point = point.clone();
                axis.values.iter().map(move |value| {
                    let mut point = point.clone();
                    point.push(value.clone());
                    point
                })
            };
            points = points.iter().flat_map(extended).collect();
        }
        points
    }

    /// What the point `values` sets, for `controller`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if two axes set the same key.
    pub(super) fn assignments(
        &self,
        values: &Values,
        controller: Option<Name>,
    ) -> Result<Vec<String>> {
        let (mut set, mut keys) = (Vec::new(), Vec::new());
        for (axis, value) in self.axes.iter().zip(values) {
            for assignment in axis.assignments(value, controller) {
                let key = assignment.split('=').next().unwrap_or_default().trim().to_owned();
                if keys.contains(&key) {
                    let problem = format!("`{key}` is set by another axis too; leave one out");
                    return Err(Error::invalid(axis.option.as_str(), problem));
                }
                keys.push(key);
                set.push(assignment);
            }
        }
        Ok(set)
    }

    /// `base` with what the point `values` sets for `controller` over it.
    ///
    /// # Errors
    /// As [`Grid::assignments`].
    pub(super) fn overrides(
        &self,
        base: &Overrides,
        values: &Values,
        controller: Option<Name>,
    ) -> Result<Overrides> {
        let mut overrides = base.clone();
        overrides.set.extend(self.assignments(values, controller)?);
        Ok(overrides)
    }

    /// `error` with the option of the axis, and the key, in place of the assignment that it made.
    pub(super) fn blamed(&self, error: Error, values: &Values) -> Error {
        let Error::Invalid { place, problem } = error else { return error };
        let controller = self.value(values, &Target::Controller).and_then(|text| name(text).ok());
        let place = self.option(&place, values, controller).unwrap_or(place);
        Error::Invalid { place, problem }
    }

    /// The option, with its key, whose assignment `place` begins with; none if it is not of an axis.
    fn option(&self, place: &str, values: &Values, controller: Option<Name>) -> Option<String> {
        let assignment = place.strip_prefix("--set ")?;
        self.axes.iter().zip(values).find_map(|(axis, value)| {
            let made = axis.assignments(value, controller);
            let is = |made: &&String| {
                assignment
                    .strip_prefix(made.as_str())
                    .is_some_and(|rest| !rest.starts_with(|c| c != ':'))
            };
            let made = made.iter().find(is)?;
            let key = made.split('=').next().unwrap_or_default();
            let named = axis.option.contains(key);
            Some(if named { axis.option.clone() } else { format!("{}: {key}", axis.option) })
        })
    }

    /// The point `values` in words, number `index` from 0.
    pub(super) fn label(&self, index: usize, total: usize, values: &Values) -> String {
        let pairs: Vec<String> = self
            .axes
            .iter()
            .zip(values)
            .filter(|(axis, _)| axis.values.len() > 1)
            .map(|(axis, value)| format!("{} {value}", axis.name))
            .collect();
        format!("point {} of {total}: {}", index + 1, pairs.join(", "))
    }

    /// The value of the axis with `target` at the point `values`.
    pub(super) fn value<'a>(&self, values: &'a Values, target: &Target) -> Option<&'a str> {
        let at = self.axes.iter().position(|axis| axis.target == *target)?;
        Some(&values[at])
    }

    /// The axes as they are stored.
    pub(super) fn records(&self) -> Vec<AxisRecord> {
        let record =
            |axis: &Axis| AxisRecord { name: axis.name.clone(), values: axis.values.clone() };
        self.axes.iter().map(record).collect()
    }
}
