//! The names that formulas may use, each with its place.

use std::collections::HashMap;

use super::fault::nearest;
use super::function::Function;
use super::token::is_name;

/// Words with a meaning of their own, and what that is.
const RESERVED: [(&str, &str); 4] = [
    ("t", "the time in seconds"),
    ("step", "the number of the step"),
    ("pi", "the number pi"),
    ("out", "the outputs of the policy's network"),
];

/// Names in order; the place of a name is its number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Names {
    list: Vec<String>,
    places: HashMap<String, u32>,
}

impl Names {
    /// Adds `name` with the next place.
    ///
    /// # Errors
    /// A sentence if it cannot be a name, or is one already.
    pub fn add(&mut self, name: &str) -> Result<(), String> {
        refuse_reserved(name)?;
        self.add_reserved(name)
    }

    /// Adds a name that formulas must not give to anything else: `t` or `step`.
    ///
    /// # Errors
    /// A sentence if it is there already.
    pub(crate) fn add_reserved(&mut self, name: &str) -> Result<(), String> {
        let place = self.list.len() as u32;
        if self.places.insert(name.to_owned(), place).is_some() {
            return Err(format!("`{name}` is defined twice"));
        }
        self.list.push(name.to_owned());
        Ok(())
    }

    /// The place of `name`.
    pub fn place(&self, name: &str) -> Option<u32> {
        self.places.get(name).copied()
    }

    /// The name at `place`.
    ///
    /// # Panics
    /// If there is none.
    pub fn at(&self, place: u32) -> &str {
        &self.list[place as usize]
    }

    /// The number of names.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The known name that is nearest to `name`, `pi` among them.
    pub(super) fn nearest(&self, name: &str) -> &str {
        let known = self.list.iter().map(String::as_str);
        nearest(name, known.chain(["pi"])).unwrap_or("pi")
    }
}

/// Refuses what formulas could not name, or would take for something else.
fn refuse_reserved(name: &str) -> Result<(), String> {
    if !is_name(name) {
        return Err("a name has letters, digits and `_`, does not begin with a digit, and is at \
                    most 64 characters long"
            .to_owned());
    }
    if Function::names().any(|function| function == name) {
        return Err(format!("`{name}` is the name of a function; choose another"));
    }
    match RESERVED.iter().find(|(reserved, _)| *reserved == name) {
        Some((_, meaning)) => Err(format!("`{name}` is {meaning}; choose another name")),
        None => Ok(()),
    }
}
