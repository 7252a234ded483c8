//! The figures of the report, one per file.

mod certified;
mod course;
mod deviation;
mod growth;
mod paths;
mod plane;
mod value;

use super::figure::Figure;
use super::slice::Grid;
use crate::scenario::record::Record;

/// All figures in the order of the page.
pub(super) fn all(record: &Record) -> [Figure; 5] {
    let grid = Grid::new(record);
    [
        value::figure(record, grid.as_ref()),
        certified::figure(record, grid.as_ref()),
        paths::figure(record, grid.as_ref()),
        deviation::figure(record),
        growth::figure(record),
    ]
}
