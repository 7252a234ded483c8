//! The page of a search for failures: what was tried, what came of it, and what it says of a claim.

use super::falsify_figures::{plane, progress};
use super::figure::Figure;
use super::shell::{self, Headline, Scripts};
use super::table::pairs;
use super::text::{capital, count, escape, interval, number, or_dash};
use crate::backend::Event;
use crate::rollout::Region;
use crate::scenario::falsify::{Against, FalsifyRecord, FileRecord};
use crate::scenario::record::Provenance;
use crate::system::Axis;

/// A search and what stands beside it.
#[derive(Clone, Debug)]
pub struct Search<'a> {
    /// What the search came to.
    pub record: &'a FalsifyRecord,
    /// The starts of the file that was given.
    pub file: Option<&'a FileRecord>,
    /// Where was looked, in words.
    pub within: &'a str,
    /// The certificate's claim about the same starts.
    pub against: Option<&'a Against>,
    /// What the search did not vary, in words.
    pub fixed: Vec<String>,
    /// Where it comes from.
    pub provenance: Provenance,
    /// What failed on the adapter and was worked around.
    pub events: Vec<Event>,
}

/// The report of a search in `region`, of a plant with the states `axes`, as one HTML document that loads
/// nothing from anywhere.
///
/// It depends on its arguments alone, so equal ones give equal pages byte for byte.
pub fn falsify_html(search: &Search<'_>, axes: &[Axis], region: &Region) -> String {
    let figures = [Some(progress(search.record)), plane(search.record, axes, region)];
    let figures: String = figures.iter().flatten().map(Figure::html).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body>\n{header}<main>\n{notes}\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">The search</h2>\n\
         <div class=\"gallery\">\n{figures}</div></section>\n\
         <section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <div class=\"tables\">\n{numbers}</div>\n{configuration}</section>\n\
         {adapter}</main>\n{footer}</body>\n</html>\n",
        head = shell::head(&title(search), "", Scripts::None),
        header = header(search),
        notes = shell::notes(&notes(search)),
        numbers = numbers(search, axes),
        configuration = shell::configuration(&search.provenance),
        adapter = shell::failures(&search.events),
        footer = shell::footer(
            &search.provenance,
            "a second search with this seed on such a machine gives the same page"
        ),
    )
}

/// What was done, and to which plant.
fn title(search: &Search<'_>) -> String {
    format!("search for failures{}", shell::of_plant(&search.provenance))
}

/// What came of it.
fn header(search: &Search<'_>) -> String {
    let record = search.record;
    let value = if record.found { "a start fails" } else { "none was found" };
    let tried = format!(
        "{} of {} rollouts, {} of them uniform draws.",
        count(record.rollouts),
        count(record.budget),
        count(record.uniform)
    );
    let mut cards = vec![Headline {
        title: format!("Failing start of {}", search.within),
        value: value.to_owned(),
        details: vec![tried],
    }];
    cards.extend(search.file.map(|file| Headline {
        title: "Starts of the file".to_owned(),
        value: format!("{} of {} fail", count(file.failures), count(file.starts)),
        details: vec!["All of them were rolled out.".to_owned()],
    }));
    let cards: String = cards.iter().map(shell::card).collect();
    let Provenance { policy, device, seed, version, .. } = &search.provenance;
    let line = format!("{policy}, seed {seed}; {device}; reachcast {version}.");
    format!(
        "<header>\n<p class=\"brand\">Reachcast search</p>\n<h1>{}</h1>\n\
         <p class=\"policy\">{}</p>\n<div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&capital(&title(search))),
        escape(&line)
    )
}

/// What a reader is to keep in mind.
fn notes(search: &Search<'_>) -> Vec<String> {
    let none = "That none was found is no proof that there is none.".to_owned();
    let none = (!search.record.found).then_some(none);
    let fixed = search.fixed.iter().map(|words| format!("Not varied: {words}."));
    let words = search.against.map(|against| &against.words);
    let words = words.into_iter().chain(search.file.map(|file| &file.words));
    none.into_iter().chain(fixed).chain(words.map(|words| format!("{words}."))).collect()
}

/// A start in words.
fn at(axes: &[Axis], x: &[f32]) -> String {
    let named = |(axis, x): (&Axis, &f32)| format!("{} {}", axis.name, number(f64::from(*x)));
    axes.iter().zip(x).map(named).collect::<Vec<_>>().join(", ")
}

/// Every number of the search.
fn numbers(search: &Search<'_>, axes: &[Axis]) -> String {
    let FalsifyRecord { rollouts, budget, uniform, uniform_failures, restarts, rounds, .. } =
        *search.record;
    let (record, best) = (search.record, search.record.best.as_ref());
    let tried = pairs(
        "What was tried",
        &[
            ("rollouts", format!("{} of {}", count(rollouts), count(budget))),
            ("batches", count(rounds)),
            ("uniform draws", count(uniform)),
            ("of which fail", count(uniform_failures)),
            ("clouds by cross-entropy and descent", count(restarts)),
            ("starts that fail", count(record.failures)),
            ("starts that fail in f32 alone", count(record.unconfirmed)),
            ("smallest measure", or_dash(best.map(|best| number(best.measure)))),
            ("its start", or_dash(best.map(|best| at(axes, &best.x)))),
        ],
    );
    let file = search.file.map_or_else(String::new, |file| {
        pairs(
            "Starts of the file",
            &[
                ("starts N", count(file.starts)),
                ("of which fail, k", count(file.failures)),
                ("95 % interval (Clopper-Pearson)", interval(file.failure_interval)),
            ],
        )
    });
    tried + &file
}
