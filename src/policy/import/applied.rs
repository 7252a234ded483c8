//! What the code of a TorchScript module applies to what it is given, followed line by line and never executed.

use std::collections::HashMap;

use super::classes::{Code, Function, is_name, shown};
use super::functional::{FUNCTIONS, activation, functional};
use crate::policy::Activation;

/// Deepest nesting of expressions and of modules, together.
const DEEPEST: usize = 64;
/// Most lines that are followed.
const MOST_LINES: usize = 100_000;
/// Longest line that is followed, bytes.
const LONGEST_LINE: usize = 1 << 14;

/// Something that is applied.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    /// A dense layer.
    Layer(Layer),
    /// What goes through an activation.
    Activation(Activation),
}

/// A dense layer of the module.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layer {
    /// The keys on the way to it, joined by dots.
    pub(super) name: String,
    /// Whether its bias is added.
    pub(super) has_bias: bool,
}

/// Truth values of a module, by the keys on the way to them, joined by dots.
pub(super) type Flags = HashMap<String, bool>;

/// What the `forward` of the whole module applies, one after the other, if these are its flags.
///
/// # Errors
/// The first line or class that does something else.
pub(super) fn steps(code: &Code<'_>, flags: &Flags) -> Result<Vec<Step>, String> {
    let part = Part { path: String::new(), class: code.root()?.to_owned() };
    let mut walk = Walk { code, flags, steps: Vec::new(), lines: 0, problem: None };
    walk.call(&part, "forward", 0)?;
    Ok(walk.steps)
}

/// A module within the whole.
#[derive(Clone, Debug)]
struct Part {
    path: String,
    class: String,
}

impl Part {
    /// The path of what it holds under `key`.
    fn key(&self, key: &str) -> String {
        match self.path.as_str() {
            "" => key.to_owned(),
            path => format!("{path}.{key}"),
        }
    }
}

/// What a name or expression stands for.
#[derive(Clone, Debug)]
enum Value {
    /// What has gone through all steps so far. There is one, which is used once, so that nothing branches.
    Stream,
    Part(Part),
    /// Weights of the part of this path.
    Weight(String),
    Transposed(String),
    /// Whether a part has a bias, and its path.
    Bias(String, bool),
    /// No bias.
    Nothing,
    /// A function of PyTorch.
    Function(String),
    /// The flag of this path.
    Flag(String),
}

/// The names of a function that is followed.
struct Scope {
    values: HashMap<String, Value>,
    depth: usize,
}

/// A walk through the code.
struct Walk<'c, 'a> {
    code: &'c Code<'a>,
    flags: &'c Flags,
    steps: Vec<Step>,
    lines: usize,
    /// Why a part that was called is not followed.
    problem: Option<String>,
}

impl<'c, 'a> Walk<'c, 'a> {
    /// Follows a method of a part from what it is given to what it gives.
    fn call(&mut self, part: &Part, method: &str, depth: usize) -> Result<(), String> {
        let class = self.code.classes.get(&part.class);
        let class = class.ok_or_else(|| format!("no code of `{}`", shown(&part.class)))?;
        if let Some(other) = class.other {
            return Err(format!("`{}`", shown(other)));
        }
        let function = class.methods.get(method);
        let function = function.ok_or_else(|| {
            format!("`{}` has no function `{}`", shown(&part.class), shown(method))
        })?;
        let &[own, input] = function.parameters.as_slice() else {
            return Err(format!("it takes `{}`", shown(&function.parameters.join(", "))));
        };
        let values = HashMap::from([
            (own.to_owned(), Value::Part(part.clone())),
            (input.to_owned(), Value::Stream),
        ]);
        self.lines(function, &mut Scope { values, depth })
    }

    /// Follows the lines of a function.
    fn lines(&mut self, function: &Function<'a>, scope: &mut Scope) -> Result<(), String> {
        for line in &function.body {
            self.lines += 1;
            let other = || format!("`{}`", shown(line));
            if self.lines > MOST_LINES || line.len() > LONGEST_LINE {
                return Err(format!("too long to be followed at {}", other()));
            }
            let line = line.trim();
            let returned = line.strip_prefix("return ");
            let (name, said) =
                returned.map(|said| ("", said)).or(line.split_once(" = ")).ok_or_else(other)?;
            let found = self.value(said, scope, scope.depth);
            let found = found.ok_or_else(|| self.problem.take().unwrap_or_else(other))?;
            match found {
                Value::Stream if returned.is_some() => return Ok(()),
                found if returned.is_none() && is_name(name) => {
                    _ = scope.values.insert(name.to_owned(), found);
                }
                _ => return Err(other()),
            }
        }
        Err("a function that gives nothing".to_owned())
    }

    /// What an expression stands for.
    fn value(&mut self, text: &str, scope: &mut Scope, depth: usize) -> Option<Value> {
        let text = text.trim();
        if depth > DEEPEST {
            let problem = format!("nested more than {DEEPEST} deep at `{}`", shown(text));
            self.problem.get_or_insert(problem);
            return None;
        }
        if is_name(text) {
            return match scope.values.get(text) {
                Some(Value::Stream) => scope.values.remove(text),
                None if text == "None" => Some(Value::Nothing),
                found => found.cloned(),
            };
        }
        if let Some(inside) = text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'))
            && is_name(inside)
        {
            return self.value(inside, scope, depth + 1);
        }
        if text.ends_with(')') {
            let (callee, arguments) = call(text)?;
            return self.called(callee, &arguments, scope, depth + 1);
        }
        if let Some(name) = text.strip_prefix(FUNCTIONS) {
            return Some(Value::Function(name.to_owned()));
        }
        let (base, key) = text.rsplit_once('.')?;
        let base = self.value(base, scope, depth + 1)?;
        self.attribute(&base, key)
    }

    /// What an attribute of a value stands for.
    fn attribute(&self, base: &Value, key: &str) -> Option<Value> {
        let Value::Part(part) = base else { return None };
        let kind = *self.code.classes.get(&part.class)?.attributes.get(key)?;
        Some(match (kind, key) {
            ("Tensor", "weight") => Value::Weight(part.path.clone()),
            ("Tensor" | "NoneType", "bias") => Value::Bias(part.path.clone(), kind == "Tensor"),
            ("bool", _) => Value::Flag(part.key(key)),
            _ if kind.starts_with("__torch__.") => {
                Value::Part(Part { path: part.key(key), class: kind.to_owned() })
            }
            _ => return None,
        })
    }

    /// What a call gives.
    fn called(
        &mut self,
        callee: &str,
        arguments: &[&str],
        scope: &mut Scope,
        depth: usize,
    ) -> Option<Value> {
        if let Some((base, method)) = callee.rsplit_once('.')
            && method.starts_with("forward")
        {
            let Value::Part(part) = self.value(base, scope, depth)? else { return None };
            let argument = match arguments {
                [] => return self.gives_nothing(&part, method).then_some(Value::Nothing),
                &[argument] => argument,
                _ => return None,
            };
            self.stream(argument, scope, depth)?;
            let called = self.call(&part, method, depth);
            return called
                .map_err(|problem| self.problem.get_or_insert(problem).clone())
                .ok()
                .map(|()| Value::Stream);
        }
        match (callee, arguments) {
            ("getattr", [base, key]) => {
                let base = self.value(base, scope, depth)?;
                self.attribute(&base, key.strip_prefix('"')?.strip_suffix('"')?)
            }
            ("torch.t", [weight]) => match self.value(weight, scope, depth)? {
                Value::Weight(path) => Some(Value::Transposed(path)),
                _ => None,
            },
            ("torch.linear", [input, weight]) => {
                self.stream(input, scope, depth)?;
                let weight = self.value(weight, scope, depth)?;
                self.layer(&weight, &Value::Nothing, true)
            }
            ("torch.linear", [input, weight, bias])
            | ("torch.addmm", [bias, input, weight, "beta=1", "alpha=1"])
            | ("torch.addmm", [bias, input, weight]) => {
                self.stream(input, scope, depth)?;
                let [weight, bias] =
                    [self.value(weight, scope, depth)?, self.value(bias, scope, depth)?];
                self.layer(&weight, &bias, callee == "torch.linear")
            }
            (_, [input, settings @ ..]) => {
                let found = self.activation(callee, settings, scope)?;
                self.stream(input, scope, depth)?;
                if found != Activation::Identity {
                    self.steps.push(Step::Activation(found));
                }
                Some(Value::Stream)
            }
            _ => None,
        }
    }

    /// Whether a method takes nothing and gives nothing, as that of a traced `Identity` does.
    fn gives_nothing(&self, part: &Part, method: &str) -> bool {
        let class = self.code.classes.get(&part.class).filter(|class| class.other.is_none());
        let function = class.and_then(|class| class.methods.get(method));
        function.is_some_and(|function| {
            function.parameters.len() == 1
                && matches!(function.body.as_slice(), [line] if line.trim() == "return None")
        })
    }

    /// Follows an argument that has to be what has gone through all steps so far.
    fn stream(&mut self, argument: &str, scope: &mut Scope, depth: usize) -> Option<()> {
        matches!(self.value(argument, scope, depth)?, Value::Stream).then_some(())
    }

    /// Adds a dense layer.
    fn layer(&mut self, weight: &Value, bias: &Value, is_plain: bool) -> Option<Value> {
        let name = match weight {
            Value::Weight(path) if is_plain => path.clone(),
            Value::Transposed(path) if !is_plain => path.clone(),
            _ => return None,
        };
        let has_bias = match bias {
            Value::Bias(path, given) if *path == name => *given,
            Value::Nothing => false,
            _ => return None,
        };
        self.steps.push(Step::Layer(Layer { name, has_bias }));
        Some(Value::Stream)
    }

    /// What a setting is, of a flag its value.
    fn setting<'s>(&mut self, setting: &'s str, scope: &Scope) -> &'s str {
        let Some(Value::Flag(path)) = scope.values.get(setting) else { return setting };
        match self.flags.get(path) {
            Some(false) => "False",
            Some(true) => {
                let problem = || {
                    format!(
                        "numbers are left out at random, since `{path}` is true; module.eval() makes `training` false"
                    )
                };
                self.problem.get_or_insert_with(problem);
                "True"
            }
            None => setting,
        }
    }

    /// The activation that a function is.
    fn activation(&mut self, callee: &str, settings: &[&str], scope: &Scope) -> Option<Activation> {
        let settings: Vec<&str> = settings.iter().map(|text| self.setting(text, scope)).collect();
        let settings = settings.as_slice();
        if let Some(name) = callee.strip_prefix("torch.") {
            return activation(name, settings);
        }
        let name = match scope.values.get(callee) {
            Some(Value::Function(name)) => name,
            _ => callee.strip_prefix(FUNCTIONS)?,
        };
        functional(self.code, name, settings)
    }
}

/// What is called, and its arguments.
fn call(text: &str) -> Option<(&str, Vec<&str>)> {
    let mut depth = 0_usize;
    let open = text.char_indices().rev().find_map(|(i, c)| {
        match c {
            ')' => depth += 1,
            '(' => depth -= 1,
            _ => {}
        }
        (depth == 0).then_some(i)
    })?;
    let inside = &text[open + 1..text.len() - 1];
    let separated = |c: char| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        c == ',' && depth == 0
    };
    let mut arguments: Vec<&str> = inside.split(separated).map(str::trim).collect();
    arguments.pop_if(|last| last.is_empty());
    Some((&text[..open], arguments))
}
