//! The code of TorchScript as classes and functions: the types of what they hold, and the lines of what they do.

use std::collections::{HashMap, HashSet};

/// Longest part of a line that a message shows, characters.
const SHOWN: usize = 120;

/// A function or method.
#[derive(Debug)]
pub(super) struct Function<'a> {
    /// Names of what it is given.
    pub(super) parameters: Vec<&'a str>,
    /// What it does, line by line.
    pub(super) body: Vec<&'a str>,
}

/// A class of modules.
#[derive(Debug, Default)]
pub(super) struct Class<'a> {
    /// Types of its attributes.
    pub(super) attributes: HashMap<&'a str, &'a str>,
    /// Its methods.
    pub(super) methods: HashMap<&'a str, Function<'a>>,
    /// The first of its lines that is neither, such as a list of hooks.
    pub(super) other: Option<&'a str>,
}

/// All classes and functions by their names, `__torch__` the first.
#[derive(Debug, Default)]
pub(super) struct Code<'a> {
    /// Classes.
    pub(super) classes: HashMap<String, Class<'a>>,
    /// Functions that are no methods.
    pub(super) functions: HashMap<String, Function<'a>>,
}

impl<'a> Code<'a> {
    /// Adds the text of the file `name`, `code/__torch__.py` for one.
    ///
    /// # Errors
    /// The first line that is not understood, or a name that is there twice.
    pub(super) fn add(&mut self, name: &str, text: &'a str) -> Result<(), String> {
        let module = name.trim_start_matches("code/").trim_end_matches(".py").replace('/', ".");
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        for block in blocks(&lines, 0) {
            let twice = |name: &str| format!("`{}` is there twice", shown(name));
            if let Some(class) = block[0].strip_prefix("class ") {
                let name = class.split('(').next().unwrap_or_default();
                let name = format!("{module}.{name}");
                if self.classes.insert(name.clone(), Class::of(block)).is_some() {
                    return Err(twice(&name));
                }
            } else if let Some((name, function)) = function(block) {
                let name = format!("{module}.{name}");
                if self.functions.insert(name.clone(), function).is_some() {
                    return Err(twice(&name));
                }
            } else if !block[0].starts_with("op_version_set = ") {
                return Err(format!("`{}`", shown(block[0])));
            }
        }
        Ok(())
    }

    /// The class of the whole module, which no other class holds.
    ///
    /// # Errors
    /// A sentence where there is none, or several.
    pub(super) fn root(&self) -> Result<&str, String> {
        let types = self.classes.values().flat_map(|class| class.attributes.values());
        let held: HashSet<&str> =
            types.flat_map(|kind| kind.split(['[', ']', ','])).map(str::trim).collect();
        let free = self.classes.keys().filter(|name| !held.contains(name.as_str()));
        let mut free: Vec<&str> = free.map(String::as_str).collect();
        free.sort_unstable();
        match free.as_slice() {
            &[root] => Ok(root),
            [] => Err("there is no code of a class of its own".to_owned()),
            [first, second, ..] => {
                Err(format!("`{}` and `{}` are no part of each other", shown(first), shown(second)))
            }
        }
    }
}

impl<'a> Class<'a> {
    /// The class of these lines, its head the first.
    fn of(lines: &[&'a str]) -> Self {
        let mut class = Self::default();
        if !lines[0].ends_with("(Module):") {
            class.other = Some(lines[0]);
        }
        for block in blocks(&lines[1..], 2) {
            if let Some((name, method)) = function(block) {
                if class.methods.insert(name, method).is_some() {
                    class.other = Some(block[0]);
                }
            } else if let Some((name, kind)) = attribute(block[0].trim()) {
                class.attributes.insert(name, kind);
            } else if !["  __parameters__ = [", "  __buffers__ = ["]
                .iter()
                .any(|list| block[0].starts_with(list))
            {
                class.other.get_or_insert(block[0]);
            }
        }
        class
    }
}

/// Runs of lines, each of which begins with a line that is indented by `indent` blanks or less.
fn blocks<'s, 'a>(lines: &'s [&'a str], indent: usize) -> Vec<&'s [&'a str]> {
    let inner = |line: &str| line.bytes().take_while(|&byte| byte == b' ').count() > indent;
    lines.chunk_by(|_, next| inner(next)).collect()
}

/// Name and type of an attribute.
fn attribute(line: &str) -> Option<(&str, &str)> {
    if let Some(rest) = line.strip_prefix("__annotations__[\"") {
        return rest.split_once("\"] = ");
    }
    line.split_once(" : ").filter(|(name, _)| is_name(name))
}

/// Name and content of the function of these lines.
fn function<'a>(lines: &[&'a str]) -> Option<(&'a str, Function<'a>)> {
    let (name, first) = lines[0].trim().strip_prefix("def ")?.split_once('(')?;
    let head = lines.iter().position(|line| line.contains("->") && line.ends_with(':'))?;
    let rest = lines[1..=head].iter().copied();
    let parameters = std::iter::once(first).chain(rest).flat_map(|line| line.split(", "));
    let named = parameters.filter_map(|text| Some(text.split_once(':')?.0.trim()));
    let function = Function {
        parameters: named.filter(|name| is_name(name)).collect(),
        body: lines[head + 1..].to_vec(),
    };
    is_name(name).then_some((name, function))
}

/// Whether a text is one name.
pub(super) fn is_name(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

/// The beginning of a text in one line, for messages.
pub(super) fn shown(text: &str) -> String {
    let visible = |c: char| if c.is_control() { '?' } else { c };
    let mut found: String = text.trim().chars().take(SHOWN).map(visible).collect();
    if text.trim().len() > found.len() {
        found.push_str("...");
    }
    found
}
