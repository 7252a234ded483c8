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
    list: Vec<Entry>,
    places: HashMap<String, u32>,
    /// Maps that formulas ask like functions of two numbers.
    maps: Vec<String>,
}

/// A name, and what it is: `a state`.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    name: String,
    what: &'static str,
}

impl Names {
    /// Adds `name`, which is `what` ("a state"), with the next place.
    ///
    /// # Errors
    /// A sentence if it cannot be a name, or is one already.
    pub fn add(&mut self, name: &str, what: &'static str) -> Result<(), String> {
        self.refuse_taken(name)?;
        self.insert(name, what);
        Ok(())
    }

    /// Adds the map `name`, which formulas ask as `name(x, y)`, with the next number of maps.
    ///
    /// # Errors
    /// As [`Names::add`].
    pub fn add_map(&mut self, name: &str) -> Result<(), String> {
        self.refuse_taken(name)?;
        self.maps.push(name.to_owned());
        Ok(())
    }

    /// Refuses what cannot be a name, or is one already.
    fn refuse_taken(&self, name: &str) -> Result<(), String> {
        refuse_reserved(name)?;
        let place = self.place(name).map(|place| self.list[place as usize].what);
        match place.or(self.map(name).map(|_| "a map")) {
            Some(before) => Err(format!("two definitions: `{name}` is {before} already")),
            None => Ok(()),
        }
    }

    /// Adds a place that formulas reach by the word `name`, which nothing else may be called.
    pub(crate) fn add_reserved(&mut self, name: &str) {
        self.insert(name, "reserved");
    }

    /// Adds a place that formulas cannot name.
    pub(crate) fn skip(&mut self) {
        self.list.push(Entry { name: String::new(), what: "nameless" });
    }

    fn insert(&mut self, name: &str, what: &'static str) {
        self.places.insert(name.to_owned(), self.list.len() as u32);
        self.list.push(Entry { name: name.to_owned(), what });
    }

    /// The place of `name`.
    pub fn place(&self, name: &str) -> Option<u32> {
        self.places.get(name).copied()
    }

    /// The number of the map `name`.
    pub fn map(&self, name: &str) -> Option<u32> {
        self.maps.iter().position(|map| map == name).map(|number| number as u32)
    }

    /// The maps, in order of their numbers.
    pub fn maps(&self) -> &[String] {
        &self.maps
    }

    /// The name at `place`.
    ///
    /// # Panics
    /// If there is none.
    pub fn at(&self, place: u32) -> &str {
        &self.list[place as usize].name
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
        let known = self.list.iter().map(|entry| entry.name.as_str());
        let known = known.filter(|known| !known.is_empty());
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
