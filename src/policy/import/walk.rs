//! What operations find and leave: the network so far, the values of a graph, and reasons to refuse.

use super::array::Array;
use super::draft::{Draft, Step};
use super::elementwise::Expression;
use super::form::Form;

/// A value of a graph.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// Numbers that do not depend on the input.
    Constant(Array),
    /// Lengths of what depends on the input, which are not all known.
    Sizes,
    /// What the network has made of the input so far.
    Number(Number),
    /// Whether a number is above a limit.
    Above(Number, f64),
}

/// What the network has made of the input so far: an expression of what a step gave.
#[derive(Clone, Debug)]
pub(super) struct Number {
    /// How many times steps were added to the network before.
    pub(super) at: usize,
    /// What is done with each number since.
    pub(super) expression: Expression,
    /// Which of the numbers, where some are left out.
    pub(super) rows: Option<Vec<usize>>,
    /// Its dimensions.
    pub(super) form: Form,
}

impl Number {
    /// The same next to a constant, which leaves it as many numbers as it has.
    pub(super) fn beside(self, constant: &Array) -> Result<Self, Problem> {
        Ok(Self { form: self.form.beside(constant)?, ..self })
    }
}

/// A graph on the way to a network.
pub(super) struct Walk {
    pub(super) draft: Draft,
    /// How many times steps were added to it.
    at: usize,
    /// Names of the weights of its layers.
    pub(super) layers: Vec<String>,
}

/// Why an operation is refused.
#[derive(Debug)]
pub(super) enum Problem {
    /// Its value has been gone on from by another one.
    Stale(String),
    /// It is none of ONNX.
    Foreign,
    /// No dense network has it.
    Unknown,
    /// In words.
    Words(String),
}

impl From<String> for Problem {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

impl From<&str> for Problem {
    fn from(words: &str) -> Self {
        Self::Words(words.to_owned())
    }
}

impl Walk {
    /// A network without a step.
    pub(super) fn of(draft: Draft) -> Self {
        Self { draft, at: 0, layers: Vec::new() }
    }

    /// What the network gives so far.
    pub(super) fn number(&self, form: Form) -> Value {
        Value::Number(Number { at: self.at, expression: Expression::plain(), rows: None, form })
    }

    /// The lengths of a value, that of the inputs not a number; where they are not known, that they are lengths.
    pub(super) fn sizes(number: &Number) -> Value {
        match number.form.sizes() {
            Some(sizes) => Value::Constant(Array::list(sizes).integers(true)),
            None => Value::Sizes,
        }
    }

    /// Whether the network has gone on from something else since.
    pub(super) fn is_stale(&self, value: &Value) -> bool {
        matches!(value, Value::Number(number) | Value::Above(number, _) if number.at != self.at)
    }

    /// Adds what was done with each number to the network, of `width` numbers where it does not know it.
    ///
    /// # Errors
    /// A sentence about an expression that is no activation, or a part that is not there.
    pub(super) fn close(&mut self, number: Number, width: Option<usize>) -> Result<(), Problem> {
        if let Some(rows) = &number.rows {
            self.draft.select(rows)?;
        }
        let steps = number
            .expression
            .steps()
            .ok_or("what comes before it is no activation that is known")?;
        for each in steps {
            let width = self.draft.width().or(width);
            let width = width.ok_or("nobody says how many numbers the input has")?;
            self.draft.push(each.step(width))?;
        }
        self.at += 1;
        Ok(())
    }

    /// Adds a step behind `number`; what the network gives then.
    ///
    /// # Errors
    /// As [`Walk::close`]; a step of another width.
    pub(super) fn push(
        &mut self,
        number: Number,
        width: usize,
        step: Step,
    ) -> Result<Value, Problem> {
        if width == 0 {
            return Err("with a constant that has no numbers".into());
        }
        let form = number.form.clone();
        self.close(number, Some(width))?;
        self.draft.push(step)?;
        Ok(self.number(form))
    }
}

/// The constant number `i` of the other inputs.
pub(super) fn constant(rest: &[Option<Value>], i: usize) -> Result<&Array, Problem> {
    match rest.get(i) {
        Some(Some(Value::Constant(array))) => Ok(array),
        Some(Some(_)) => Err("of two values that both depend on the input".into()),
        _ => Err("an input is missing".into()),
    }
}

/// The same, where the input may be left out.
pub(super) fn optional(rest: &[Option<Value>], i: usize) -> Result<Option<&Array>, Problem> {
    match rest.get(i) {
        None | Some(None) => Ok(None),
        Some(Some(_)) => constant(rest, i).map(Some),
    }
}
