//! References of a description: numbers that its costs are told, fixed or changing from step to step.

use std::path::{Path, PathBuf};

use super::names::Scope;
use super::origin::Origin;
use super::section::Section;
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::files::StateReader;
use crate::formula::text::{Networks, Values};
use crate::formula::{Expr, record};
use crate::model::{Reference, ReferenceSource};
use crate::real::Real;

/// Most references of a model.
pub const MOST_REFERENCES: usize = 64;
/// Most rows of the file of a reference.
const MOST_ROWS: usize = 1 << 20;
/// How a reference is written.
const EXPECTED: &str = "one of `value`, a number, `formula`, of `t` and `step`, and `file`, a row for \
                        each step";

/// A reference as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenReference {
    /// Its name.
    pub name: String,
    /// Its dotted key, as in `model.references.goal`.
    pub key: String,
    /// Where it comes from.
    pub source: WrittenSource,
}

/// Where a reference comes from, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum WrittenSource {
    /// A number.
    Value(f32),
    /// A formula of the time and the number of the step.
    Formula(Written),
    /// A .csv or .npy file of one column, a row for each step.
    File(PathBuf),
}

/// Reads `[model.references]` and adds its names to `inner`; formulas know those of `scope`.
pub(super) fn references(
    section: Option<Section<'_>>,
    scope: &Scope,
    inner: &mut Scope,
) -> Result<Vec<WrittenReference>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    section.at_most("references", MOST_REFERENCES)?;
    let read = |(name, _)| {
        inner.declare(&section, name, "a reference")?;
        let entry = section.required(name, "{ value = 0.0 }")?;
        let source = source(&entry, scope)?;
        Ok(WrittenReference { name: name.to_owned(), key: section.at(name), source })
    };
    section.entries().map(read).collect()
}

/// What `entry` says.
fn source(entry: &Section<'_>, scope: &Scope) -> Result<WrittenSource> {
    const KEYS: [&str; 3] = ["value", "formula", "file"];
    entry.only(KEYS.into_iter())?;
    if KEYS.iter().filter(|key| entry.has(key)).count() != 1 {
        return Err(entry.refuse_whole(format!("expected {EXPECTED}")));
    }
    if let Some(value) = entry.number("value")? {
        let finite = value.is_finite();
        let refused = || entry.refuse("value", format!("{value} is not a finite number as f32"));
        return finite.then_some(WrittenSource::Value(value)).ok_or_else(refused);
    }
    if let Some(file) = entry.text("file")? {
        return Ok(WrittenSource::File(entry.origin.folder.join(file)));
    }
    let written = Written::optional(entry, "formula", scope, FormulaKind::Reference)?;
    written.map(WrittenSource::Formula).ok_or_else(|| entry.refuse_whole(EXPECTED))
}

impl WrittenReference {
    /// The reference, its file read. A formula has its inputs among `inputs` of the model, of which it
    /// reads the last two.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the key of a file that cannot be read, has more than one column or
    /// a number that is not finite.
    pub(super) fn read(&self, inputs: usize, origin: &Origin) -> Result<Reference> {
        let source = match &self.source {
            WrittenSource::Value(value) => ReferenceSource::Fixed(*value),
            WrittenSource::Formula(written) => ReferenceSource::Formula(record(2, |time| {
                let mut names = vec![Expr::lit(0.0); inputs - 2];
                names.extend(time);
                let networks = &Networks::default();
                let values = Values { names: &names, outputs: &[], looked: &[], networks };
                vec![written.formula.value(values)]
            })),
            WrittenSource::File(path) => ReferenceSource::Rows(self.rows(path, origin)?),
        };
        let reference = Reference { name: self.name.clone(), source };
        match reference.at(0, 0.0) {
            first if first.is_finite() => Ok(reference),
            first => {
                let problem = format!("{first} at step 0; expected a finite number at each step");
                Err(origin.refuse(&self.key, problem))
            }
        }
    }

    /// The rows of the file at `path`.
    fn rows(&self, path: &Path, origin: &Origin) -> Result<Vec<f32>> {
        let refused = |problem: String| origin.refuse(&format!("{}.file", self.key), problem);
        let shape = "a reference has one column, a number for each step";
        let reader = StateReader::open(path, vec![self.name.clone()]);
        let rows = reader.and_then(|mut reader| reader.next(MOST_ROWS + 1));
        let rows = rows.map_err(|error| refused(format!("{error}; {shape}")))?;
        if rows.len() > MOST_ROWS {
            let problem = format!("{}: more than {MOST_ROWS} rows", path.display());
            return Err(refused(problem));
        }
        Ok(rows.iter().map(|row| row[0]).collect())
    }
}
