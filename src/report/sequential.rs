//! The sequential claim on the page: what came of it, and its evidence.

use super::table::{pairs, table};
use super::text::{count, number};
use crate::scenario::record::{Record, SequentialRecord};
use crate::scenario::sequential_record::{SequentialOf, SequentialOutcome};

/// Rows of the table of evidence.
const ROWS: usize = 24;

/// What came of it, and the evidence; empty where no such claim is asked for.
pub(crate) fn sequential(record: &Record) -> String {
    record.sequential.as_ref().map_or_else(String::new, |asked| outcome(asked) + &process(asked))
}

/// What came of it.
fn outcome(asked: &SequentialRecord) -> String {
    let of = match asked.of {
        SequentialOf::Set => "of the certified set, perturbed",
        SequentialOf::Ball => "of the ball around the state",
        _ => "of the box",
    };
    let outcome = match asked.outcome {
        SequentialOutcome::Certified => "the claim holds",
        SequentialOutcome::Hopeless => "hopeless: too many starts fail",
        SequentialOutcome::Undecided => "undecided at the last draw allowed",
    };
    pairs(
        "Starts one after the other",
        &[
            ("starts", of.to_owned()),
            ("outcome", outcome.to_owned()),
            ("draws", count(asked.draws)),
            ("starts that count", count(asked.claim.scenarios)),
            ("failures", count(asked.claim.failures)),
            ("ln of the e-value, earlier attempts included", number(asked.log_e)),
            ("ln of the e-value needed", number(asked.log_needed)),
            ("carried over from earlier attempts", number(asked.carried)),
            ("ln of the evidence of a larger risk", number(asked.log_against)),
        ],
    )
}

/// The evidence along the starts, its last point the last row.
fn process(asked: &SequentialRecord) -> String {
    let points = &asked.process;
    let every = points.len().div_ceil(ROWS).max(1);
    let shown = points.iter().rev().step_by(every).collect::<Vec<_>>().into_iter().rev();
    let rows =
        shown.map(|point| vec![count(point.starts), count(point.failures), number(point.log_e)]);
    let head = ["starts", "failures", "ln of the e-value"].map(str::to_owned).to_vec();
    table("Evidence", &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}
