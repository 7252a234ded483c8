//! The page of a race experiment: rates, failures, tiers, one race in time, and every number.

mod failures;
mod film;
mod findings;
pub(in crate::race) mod losses;
mod moment;
pub(in crate::race) mod provenance;
mod success;
mod table;
mod tiers;
pub(in crate::race) mod verdicts;
mod words;

use crate::race::record::RaceRecord;
use crate::report::shell::{self, HATCH, SHEET_STYLE, Scripts, WEAVES, items};
use crate::report::text::{count, counted, escape, listed};

const RACE_STYLE: &str = include_str!("race.css");
/// Steps through the moments of the race that is shown.
const SCRIPT: &str = include_str!("race.js");
/// The report of a race experiment as one HTML document that loads nothing from anywhere.
///
/// It depends on the record alone, so equal records give equal pages byte for byte. One inline
/// script steps through the race that is shown; without it the page shows the first moment.
pub fn race_html(record: &RaceRecord) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body class=\"race\">\n{HATCH}{WEAVES}{header}\
         <main>\n{statements}{adapter}\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">Pictures</h2>\n\
         <div class=\"gallery\">\n{success}{failures}{tiers}{film}</div></section>\n\
         {numbers}</main>\n{footer}{script}</body>\n</html>\n",
        head = shell::head("race study", &format!("{SHEET_STYLE}{RACE_STYLE}"), Scripts::Own),
        header = header(record),
        statements = statements(record),
        adapter = shell::failures(&record.events) + &shell::notes(&record.notes),
        success = success::figure(record).html(),
        failures = failures::figure(record).html(),
        tiers = tiers::figure(record).html(),
        film = film::figure(record).html(),
        numbers = numbers(record),
        footer = shell::footer(&record.provenance, "compute times are stored apart"),
        script = script(record),
    )
}

fn header(record: &RaceRecord) -> String {
    let cards: String = findings::headlines(record).iter().map(shell::card).collect();
    format!(
        "<header>\n<p class=\"brand\">Reachcast race study</p>\n<h1>{}</h1>\n\
         <p class=\"policy\">{}</p>\n<p class=\"policy\">Policy: {}</p>\n\
         <div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&title(record)),
        escape(&setting(record)),
        escape(&record.provenance.policy),
    )
}

fn title(record: &RaceRecord) -> String {
    let controllers = counted(record.controllers.len(), "controller", "controllers");
    format!("{controllers} on the same {} starts", count(record.starts.count))
}

fn setting(record: &RaceRecord) -> String {
    let seeds: Vec<_> = record.noise_seeds.iter().map(u64::to_string).collect();
    let seeds = match &seeds[..] {
        [] => "no noise seed".to_owned(),
        [only] => format!("noise seed {only}"),
        _ => format!("noise seeds {}", listed(&seeds)),
    };
    format!("Starts: {}. Every controller flew all of them with {seeds}.", record.starts.source)
}

fn statements(record: &RaceRecord) -> String {
    let described = record.controllers.iter().map(|controller| {
        let [name, description] = [&controller.name, &controller.description].map(|s| escape(s));
        format!("<dt>{name}</dt><dd>{description}</dd>")
    });
    format!(
        "<div class=\"words\"><div><section aria-labelledby=\"found\">\
         <h2 id=\"found\">What was found</h2>\n<ol class=\"statements\">\n{}</ol></section>\n\
         <section aria-labelledby=\"controllers\"><h2 id=\"controllers\">Controllers</h2>\n\
         <dl class=\"described\">{}</dl></section></div>\n\
         <section class=\"card limits\" aria-labelledby=\"limits\">\
         <h2 id=\"limits\">What this does not say</h2>\n<ul>\n{}</ul></section></div>\n",
        items(&findings::found(record)),
        described.collect::<String>(),
        items(&findings::limits(record))
    )
}

fn numbers(record: &RaceRecord) -> String {
    format!(
        "<section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <p class=\"hint\">Intervals are rounded outwards, betas and p-values up. Every digit is \
         in <code>results.json</code>.</p>\n\
         {}<div class=\"tables\">\n{}</div>\n\
         {}</section>\n",
        table::wide(record),
        table::narrow(record),
        shell::configuration(&record.provenance)
    )
}

/// The script, where there is a race to step through.
fn script(record: &RaceRecord) -> String {
    let frames = record.picture.as_ref().map_or(0, |picture| picture.frames.len());
    if frames == 0 { String::new() } else { format!("<script>\n{SCRIPT}</script>\n") }
}
