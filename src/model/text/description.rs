//! What a text says about a model and its policy, checked, its formulas parsed.

use toml::Table;

use super::axes::{self, State};
use super::bodies::{self, Bodies};
use super::costs::{self, WrittenCosts};
use super::disturbances::{self, Disturbance};
use super::dynamics::{self, Dynamics};
use super::lets::Lets;
use super::names::{Scope, Seconds};
use super::network_file::NetworkFile;
use super::origin::Origin;
use super::policy::{self, Policy};
use super::section::Section;
use super::shapes;
use super::task::{self, WrittenTask};
use crate::error::Result;
use crate::formula::text::{LONGEST_TEXT, shown};
use crate::model::Shape;
use crate::system::{Axis, Parameter};

/// Keys of `[model]`.
const KEYS: [&str; 15] = [
    "name",
    "states",
    "controls",
    "parameters",
    "disturbances",
    "let",
    "next",
    "flow",
    "time",
    "task",
    "bodies",
    "shapes",
    "costs",
    "references",
    "maps",
];
/// Sections of `[model]` that are refused by name, and what they would be.
const LATER: [(&str, &str); 1] = [("noise", "measurement noise does")];

/// A model and its policy as a text describes them: every name known, every formula parsed.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Short name.
    pub name: String,
    /// States in order.
    pub states: Vec<State>,
    /// Controls in order, with their bounds.
    pub controls: Vec<Axis>,
    /// Numbers that are fixed for a rollout.
    pub parameters: Vec<Parameter>,
    /// Numbers that act at every step where a policy is trained against them.
    pub disturbances: Vec<Disturbance>,
    /// Seconds between two steps, where the text says.
    pub period: Option<f32>,
    /// How the state moves on.
    pub dynamics: Dynamics,
    /// What a rollout has to do, and the margins.
    pub task: WrittenTask,
    /// What plans cost, where the text says; no part of the plant and its task.
    pub costs: Option<WrittenCosts>,
    /// The bodies that pictures show.
    pub bodies: Bodies,
    /// The shapes that pictures show.
    pub shapes: Vec<Shape>,
    /// What makes the controls, where the text says.
    pub policy: Option<Policy>,
    pub(super) lets: Lets,
    /// The networks that formulas call, where they were given.
    pub(super) networks: Option<Vec<NetworkFile>>,
    pub(super) origin: Origin,
}

impl Description {
    /// Reads the sections `model` and `policy`.
    pub(super) fn read(table: &Table, origin: &Origin) -> Result<Self> {
        let root = Section::root(origin, table);
        let model = root.required("model", "a section that describes the plant and its task")?;
        check_keys(&model)?;
        check_length(&model)?;
        let mut scope = Scope::default();
        let name = name(&model)?;
        let states = model.required("states", "the states by name")?;
        let states = axes::states(&states, &mut scope)?;
        let controls = model.required("controls", "the controls by name")?;
        let controls = axes::controls(&controls, &mut scope)?;
        let parameters = axes::parameters(model.section("parameters")?, &mut scope)?;
        let time = dynamics::time(model.section("time")?.as_ref())?;
        scope.declare_time(if time.period.is_some() { Seconds::Known } else { Seconds::Unknown });
        let disturbances = disturbances::disturbances(model.section("disturbances")?, &mut scope)?;
        let lets = Lets::read(model.section("let")?, &mut scope)?;
        let state_names: Vec<&str> = states.iter().map(|state| state.axis.name.as_str()).collect();
        let control_names: Vec<&str> = controls.iter().map(|axis| axis.name.as_str()).collect();
        let policy = root.section("policy")?;
        let policy = policy.map(|policy| policy::policy(&policy, &control_names, &scope));
        let dynamics = dynamics::dynamics(&model, &state_names, time, &scope)?;
        let policy = policy.transpose()?.flatten();
        Ok(Self {
            task: task::task(
                &model.required("task", "the kind and its margins")?,
                &scope,
                &dynamics,
                time.period,
            )?,
            dynamics,
            costs: costs::costs(&model, &scope)?,
            bodies: bodies::bodies(model.section("bodies")?, &scope)?,
            shapes: shapes::shapes(model.section("shapes")?)?,
            policy,
            name,
            states,
            controls,
            parameters,
            disturbances,
            period: time.period,
            lets,
            networks: None,
            origin: origin.clone(),
        })
    }
}

/// Refuses keys of `[model]` that are unknown, and those that do not work yet.
fn check_keys(model: &Section<'_>) -> Result<()> {
    let later = LATER.iter().map(|(key, _)| *key);
    model.only(KEYS.into_iter().chain(later))?;
    match LATER.iter().find(|(key, _)| model.has(key)) {
        Some((key, what)) => {
            Err(model.refuse(key, format!("{what} not work yet; leave the section out")))
        }
        None => Ok(()),
    }
}

/// Refuses a model whose keys and formulas together are too long.
fn check_length(model: &Section<'_>) -> Result<()> {
    let length = model.length();
    if length > LONGEST_TEXT {
        let problem = format!("a model of {length} bytes, at most {LONGEST_TEXT} are read");
        return Err(model.refuse_whole(problem));
    }
    Ok(())
}

fn name(model: &Section<'_>) -> Result<String> {
    let missing = || model.refuse("name", "missing; expected a short name");
    let name = model.text("name")?.ok_or_else(missing)?;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > 64 || !name.chars().all(plain) {
        let problem = format!("`{}`; expected 1 to 64 letters, digits, `-` and `_`", shown(name));
        return Err(model.refuse("name", problem));
    }
    Ok(name.to_owned())
}
