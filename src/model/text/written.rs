//! Formulas where they stand: each with its key and text, checked against what it may use.

use toml::Value;

use super::names::Scope;
use super::origin::Origin;
use super::section::{Section, unknown};
use crate::error::{Error, Result};
use crate::formula::text::{Fault, Formula, Use};

/// A formula of a description.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Its dotted key, as in `model.flow.x`.
    pub key: String,
    /// As it is written.
    pub text: String,
    /// As it is understood.
    pub formula: Formula,
}

/// What a formula is for, which says what it may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FormulaKind {
    /// Intermediate formulas, derivatives and next values: states, controls, parameters, time.
    Dynamics,
    /// Margins: no controls.
    Task,
    /// Where a picture shows a body: no controls.
    Picture,
    /// What a policy sees, or a policy by formulas: no controls.
    Policy,
    /// The control from a network's output: no controls, but the outputs.
    Act,
    /// The cost of a stage: all of them, and references.
    Stage,
    /// The cost of the end of a plan: the same without controls.
    Terminal,
    /// What costs are told at a step: time alone.
    Reference,
}

impl FormulaKind {
    /// What a formula may use, for an error about one that uses more.
    fn allowed(self) -> &'static str {
        match self {
            Self::Dynamics => "dynamics know states, controls, parameters, disturbances and time",
            Self::Task => "a margin knows states, parameters and time",
            Self::Picture => "a body stands where states, parameters and time say",
            Self::Stage => "the cost of a stage knows states, controls, references and time",
            Self::Terminal => {
                "a terminal cost is of the state after the last control, and knows states, \
                 references, parameters and time"
            }
            Self::Reference => "a reference knows `t` and `step` alone",
            Self::Policy | Self::Act => {
                "a policy knows states, parameters and time, and makes the controls"
            }
        }
    }
}

impl Written {
    /// Parses the text `value` at `key` of `section`.
    pub(super) fn read(
        section: &Section<'_>,
        key: &str,
        value: &Value,
        scope: &Scope,
        kind: FormulaKind,
    ) -> Result<Self> {
        let Value::String(text) = value else {
            let expected = "a formula as text, for instance \"2 * sin(t)\"";
            return Err(section.wrong(key, expected, value));
        };
        let key = section.at(key);
        let refuse = |fault: &Fault| section.origin.refuse_formula(&key, text, fault);
        let formula = Formula::parse(text, &scope.names).map_err(|fault| refuse(&fault))?;
        let written = Self { key: key.clone(), text: text.clone(), formula };
        written.check(section.origin, scope, kind)?;
        Ok(written)
    }

    /// Parses what stands at `key` of `section`, if something does.
    pub(super) fn optional(
        section: &Section<'_>,
        key: &str,
        scope: &Scope,
        kind: FormulaKind,
    ) -> Result<Option<Self>> {
        let value = section.entries().find(|(name, _)| *name == key);
        value.map(|(_, value)| Self::read(section, key, value, scope, kind)).transpose()
    }

    /// Refuses what the kind does not allow.
    fn check(&self, origin: &Origin, scope: &Scope, kind: FormulaKind) -> Result<()> {
        if kind != FormulaKind::Act
            && let Some(output) = self.formula.outputs().next()
        {
            let problem = "`out` stands in `act` of `[policy]` alone";
            return Err(self.refuse(origin, output.at, problem));
        }
        match kind {
            FormulaKind::Dynamics | FormulaKind::Stage => Ok(()),
            FormulaKind::Reference => self.check_time(origin, scope),
            _ => self.check_deeds(origin, scope, kind),
        }
    }

    /// Refuses all but the time and the number of the step.
    fn check_time(&self, origin: &Origin, scope: &Scope) -> Result<()> {
        let allowed = FormulaKind::Reference.allowed();
        if let Some(call) = self.formula.networks().first() {
            return Err(self.refuse(origin, call.at, format!("it calls a network; {allowed}")));
        }
        let time = scope.inputs() as u32 - 2..scope.inputs() as u32;
        match self.formula.names().find(|found| !time.contains(&found.number)) {
            Some(Use { number, at }) => {
                let name = scope.names.at(number);
                Err(self.refuse(origin, at, format!("it reads `{name}`; {allowed}")))
            }
            None => Ok(()),
        }
    }

    /// Refuses controls and disturbances, whether used here or by an intermediate formula.
    fn check_deeds(&self, origin: &Origin, scope: &Scope, kind: FormulaKind) -> Result<()> {
        for Use { number, at } in self.formula.names() {
            let Some(deed) = scope.deed_behind(number) else { continue };
            let kind_of = if scope.is_control(deed) { "control" } else { "disturbance" };
            let (name, deed) = (scope.names.at(number), scope.names.at(deed));
            let what = if name == deed {
                format!("`{name}` is a {kind_of}")
            } else {
                format!("`{name}` uses the {kind_of} `{deed}`")
            };
            return Err(self.refuse(origin, at, format!("{what}; {}", kind.allowed())));
        }
        Ok(())
    }

    /// The refusal of what stands at byte `at`.
    pub(super) fn refuse(&self, origin: &Origin, at: usize, problem: impl Into<String>) -> Error {
        origin.refuse_formula(&self.key, &self.text, &Fault { at, problem: problem.into() })
    }
}

/// The formulas of `section`, one for each of `wanted` in their order; a key without one, or none
/// for a key, is refused with the word that says what a formula is for.
pub(super) fn one_each<'a>(
    section: &Section<'_>,
    wanted: impl Iterator<Item = &'a str> + Clone,
    words: Words,
    read: impl Fn(&str, &Value) -> Result<Written>,
) -> Result<Vec<Written>> {
    for (key, _) in section.entries() {
        if wanted.clone().all(|name| name != key) {
            let problem = unknown(words.name, key, wanted);
            return Err(section.refuse(key, problem));
        }
    }
    let found = |name: &str| section.entries().find(|(key, _)| *key == name).map(|(_, v)| v);
    wanted
        .map(|name| {
            let missing = || section.refuse_whole(format!("no {} `{name}`", words.formula));
            read(name, found(name).ok_or_else(missing)?)
        })
        .collect()
}

/// How errors speak of formulas by name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    /// What the names are: `state`.
    pub(super) name: &'static str,
    /// What each has: `derivative of`.
    pub(super) formula: &'static str,
}
