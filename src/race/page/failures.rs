//! How the other races were lost: a stacked bar per controller.

use super::losses::{self, Row};
use super::words;
use crate::race::judge::Judge;
use crate::race::record::RaceRecord;
use crate::report::figure::Figure;
use crate::report::sheet::panels;

/// One panel per judge.
pub(super) fn figure(record: &RaceRecord) -> Figure {
    let judges = words::judges(record).into_iter();
    let drawn: Vec<_> = judges
        .filter(|&judge| words::verdicts(record, judge).next().is_some())
        .map(|judge| (format!("{} judge", judge.name()), panel(record, judge)))
        .collect();
    Figure {
        id: "figure-failures",
        title: "How the others were lost".to_owned(),
        drawing: match drawn.is_empty() || words::races(record) == 0 {
            true => Err("No race was run.".to_owned()),
            false => Ok(panels(&drawn)),
        },
        legend: losses::legend(),
        caption: "Shares of all races, over all noise seeds; the empty rest was won. A lost race \
                  counts in one class."
            .to_owned(),
    }
}

fn panel(record: &RaceRecord, judge: Judge) -> String {
    let races = words::races(record);
    let rows = words::verdicts(record, judge).map(|(controller, judged)| Row {
        name: controller.name.clone(),
        judged,
        races,
    });
    losses::panel(rows, &format!("Failure classes under the {} judge", judge.name()))
}
