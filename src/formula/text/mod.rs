//! Formulas as text: parsed once into a list of operations with functions whole, evaluated over any
//! scalar, and so recorded as a graph.

mod fault;
mod formula;
mod function;
mod names;
mod networks;
mod parser;
mod term;
mod token;

pub use fault::Fault;
#[cfg(feature = "cli")]
pub(crate) use fault::meant;
pub(crate) use fault::{nearest, shown};
pub use formula::{Formula, Lookup, MOST_NODES, NetworkCall, Use};
pub use function::Function;
pub use names::Names;
pub use networks::Networks;
pub use term::{Comparison, Operation, Term, Values};
pub(crate) use token::{LONGEST_NAME, is_name};

use parser::Parser;

/// Longest text of a model, and so of a formula, in bytes.
pub const LONGEST_TEXT: usize = 1 << 20;

impl Formula {
    /// Parses `text`, which may use `names`, functions, `pi`, `out[i]` and `net(...)[i]`.
    ///
    /// ```
    /// use reachcast::formula::text::{Formula, Names, Networks, Values};
    /// let mut names = Names::default();
    /// names.add("x", "a state")?;
    /// let formula = Formula::parse("-x^2 + 2 * hypot(x, 4)", &names).expect("a formula");
    /// let networks = Networks::default();
    /// let values = Values { names: &[3.0_f32], outputs: &[], looked: &[], networks: &networks };
    /// assert_eq!(formula.value(values), 1.0);
    /// let fault = Formula::parse("1 + cosh(x)", &names).expect_err("no such function");
    /// assert_eq!(fault.problem, "unknown function `cosh`; the nearest is `cos`");
    /// # Ok::<(), String>(())
    /// ```
    ///
    /// # Errors
    /// The first fault: what was found at which place, what was expected, and the nearest name.
    pub fn parse(text: &str, names: &Names) -> Result<Self, Fault> {
        if text.len() > LONGEST_TEXT {
            let problem =
                format!("a formula of {} bytes, at most {LONGEST_TEXT} are read", text.len());
            return Err(Fault::new(0, problem));
        }
        Parser::new(text, names)?.formula()
    }
}
