//! Plants of a program of one's own: what the section `[system]` may name beside those that are carried.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::formula_name::no_formula;
use crate::error::{Error, Result};
use crate::model::{Controller, Costs, Model, Plant};
use crate::studies::SYSTEMS;

/// Plants that are written in Rust, by the names that configurations have for them.
///
/// ```
/// use reachcast::config::{Registered, Registry};
/// use reachcast::model::{Controller, Model};
/// use reachcast::system::{BangBang, DoubleIntegrator};
///
/// // `[system] name = "sled"`, `acceleration = 2.0`, and `[policy] formula = "bang-bang"`.
/// let registry = Registry::new().with("sled", |numbers| {
///     let acceleration = numbers.number("acceleration", 1.0) as f32;
///     let sled = DoubleIntegrator { acceleration, ..DoubleIntegrator::default() };
///     let policy = Controller::of(&sled, BangBang { acceleration });
///     Ok(Registered::new(Model::of(sled)).formula("bang-bang", policy))
/// })?;
/// assert_eq!(registry.names(), ["sled"]);
/// # Ok::<(), reachcast::Error>(())
/// ```
#[derive(Clone, Default)]
pub struct Registry {
    plants: Vec<Arc<Entry>>,
}

/// A name, and what makes a plant of numbers.
struct Entry {
    name: String,
    make: Box<Make>,
}

/// What makes a plant of the numbers of its section.
type Make = dyn Fn(&mut Numbers) -> Result<Registered> + Send + Sync;

/// The keys of `[system]` beside the name, each a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Numbers {
    given: BTreeMap<String, f64>,
    read: BTreeMap<String, f64>,
}

impl Numbers {
    /// The number `key`, `default` where the configuration has none. A key that is never asked for is
    /// refused with the nearest of those that are.
    pub fn number(&mut self, key: &str, default: f64) -> f64 {
        let value = self.given.get(key).copied().unwrap_or(default);
        self.read.insert(key.to_owned(), value);
        value
    }
}

/// A plant that is written in Rust, with the policies that go by a name.
#[derive(Clone, Debug)]
pub struct Registered {
    model: Arc<Model>,
    formulas: Vec<(String, Arc<Controller>)>,
    costs: Option<Costs>,
}

impl Registered {
    /// The model, which a network of a file may drive.
    pub fn new(model: Model) -> Self {
        Self { model: Arc::new(model), formulas: Vec::new(), costs: None }
    }

    /// The same with a policy that `policy.formula = "name"` asks for.
    #[must_use]
    pub fn formula(mut self, name: impl Into<String>, controller: Controller) -> Self {
        self.formulas.push((name.into(), Arc::new(controller)));
        self
    }

    /// The same with what plans in closed loop cost, for the command `plan`.
    #[must_use]
    pub fn costs(self, costs: Costs) -> Self {
        Self { costs: Some(costs), ..self }
    }

    /// What plans cost, where somebody said so.
    pub(super) fn planned(&self) -> Option<&Costs> {
        self.costs.as_ref()
    }

    /// The model.
    pub(super) fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The plant under the policy `name`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a policy that it does not have.
    pub(super) fn under_formula(&self, name: &str) -> Result<Plant> {
        let found = self.formulas.iter().find(|(own, _)| own == name);
        let Some((_, controller)) = found else {
            let names: Vec<&str> = self.formulas.iter().map(|(own, _)| own.as_str()).collect();
            let has = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(no_formula(&self.model.name, name, &has));
        };
        Ok(Plant { model: Arc::clone(&self.model), controller: Arc::clone(controller) })
    }
}

/// A plant with the numbers that it is made of.
pub(super) struct Made {
    /// The plant.
    pub(super) plant: Registered,
    /// Every number that it has asked for.
    pub(super) numbers: BTreeMap<String, f64>,
}

impl Registry {
    /// No plant beside those that are carried.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same with a plant that configurations call `name`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a name that is taken.
    pub fn with(
        mut self,
        name: impl Into<String>,
        make: impl Fn(&mut Numbers) -> Result<Registered> + Send + Sync + 'static,
    ) -> Result<Self> {
        let name = name.into();
        if self.has(&name) || SYSTEMS.contains(&name.as_str()) {
            let problem = format!("`{name}` is taken; give the plant another name");
            return Err(Error::invalid("registry", problem));
        }
        self.plants.push(Arc::new(Entry { name, make: Box::new(make) }));
        Ok(self)
    }

    /// The names in the order of their entry.
    pub fn names(&self) -> Vec<&str> {
        self.plants.iter().map(|entry| entry.name.as_str()).collect()
    }

    /// Whether it has a plant of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.plants.iter().any(|entry| entry.name == name)
    }

    /// All names that `[system]` may have, the carried ones first.
    pub(super) fn all_names(&self) -> Vec<&str> {
        SYSTEMS.into_iter().chain(self.names()).collect()
    }

    /// The plant `name` of the numbers `given`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a name that it does not have, and those of what makes the plant.
    pub(super) fn make(&self, name: &str, given: &BTreeMap<String, f64>) -> Result<Made> {
        let entry = self.plants.iter().find(|entry| entry.name == name).ok_or_else(|| {
            let problem =
                format!("`{name}` is unknown; expected one of {}", self.all_names().join(", "));
            Error::invalid("system.name", problem)
        })?;
        let mut numbers = Numbers { given: given.clone(), read: BTreeMap::new() };
        let plant = (entry.make)(&mut numbers)?;
        Ok(Made { plant, numbers: numbers.read })
    }
}

impl fmt::Debug for Registry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Registry").field(&self.names()).finish()
    }
}

impl PartialEq for Registry {
    /// A configuration asks for the same whichever program reads it.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
