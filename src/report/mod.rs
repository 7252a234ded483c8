//! Reports.

use crate::scenario::record::Record;

/// The report as one HTML document.
pub fn html(record: &Record) -> String {
    record.statements.join("\n")
}
