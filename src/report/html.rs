//! The page: verdict, statements, figures and numbers of a record.

use super::figures;
use super::growth;
use super::palette;
use super::sequential;
use super::sets;
use super::shell::{self, HATCH, Scripts, items};
use super::table;
use super::text::{escape, upper};
use super::words::{self, Verdict};
use super::{deterministic, enclosed};
use crate::rollout::PairControl;
use crate::scenario::record::{GrowthOutcome, Record};
use crate::scenario::settings::Joint;

/// What the footer says of two runs with one seed.
const SAME: &str = "only the wall time and the threads differ between two runs with the same seed";

/// The report as one HTML document that loads nothing from anywhere.
///
/// It depends on the record alone, so equal records give equal pages byte for byte; only
/// `record.timing` differs between two runs of a configuration.
pub fn html(record: &Record) -> String {
    let [value, certified, paths, deviation, growth] =
        figures::all(record).map(|figure| figure.html());
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body>\n{HATCH}{header}<main>\n{statements}{failures}\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">Pictures</h2>\n\
         <div class=\"figures\">\n{value}{certified}{paths}{deviation}{growth}</div></section>\n{numbers}</main>\n{footer}\
         </body>\n</html>\n",
        head = shell::head(&record.system.name, &palette::rules(), Scripts::None),
        header = header(record),
        statements = statements(record),
        failures = shell::failures(&record.events),
        numbers = numbers(record),
        footer = shell::footer(&record.provenance, SAME),
    )
}

fn header(record: &Record) -> String {
    let verdicts = words::verdicts(record);
    let (class, mark, verdict) = if record.holds {
        ("good", "✓", "Every claim that was asked for was obtained.".to_owned())
    } else {
        ("bad", "✗", missing(&verdicts))
    };
    let whole = record
        .whole_box
        .as_ref()
        .map(|found| escape(&format!(" What is said of the box: {}.", found.verdict)));
    let whole = whole.unwrap_or_default();
    let sought = record.looked_for().map(|found| escape(&format!(" Beside them, {found}.")));
    let sought = sought.unwrap_or_default();
    let cards: String = verdicts.iter().map(card).collect();
    format!(
        "<header>\n<p class=\"brand\">Reachcast certificate</p>\n<h1>{}</h1>\n\
         <p class=\"policy\">Policy: {}</p>\n\
         <p class=\"verdict {class}\"><span aria-hidden=\"true\">{mark}</span> {verdict}{sought}{whole}</p>\n\
         <div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&record.system.name),
        escape(&record.provenance.policy),
    )
}

/// Which claims were not obtained.
fn missing(verdicts: &[Verdict]) -> String {
    let missing = verdicts.iter().filter(|verdict| !verdict.obtained);
    let names: Vec<_> = missing.map(|verdict| verdict.title.to_lowercase()).collect();
    if names.is_empty() {
        "Not every claim that was asked for was obtained.".to_owned()
    } else {
        format!("Not obtained: {}.", names.join(", "))
    }
}

fn card(verdict: &Verdict) -> String {
    let (class, mark, status) =
        if verdict.obtained { ("good", "✓", "obtained") } else { ("bad", "✗", "not obtained") };
    let beta = verdict.claim.map_or_else(String::new, |claim| {
        format!("Confidence 1 − {} over the draw.", upper(claim.beta))
    });
    format!(
        "<section class=\"card claim {class}\"><h2>{}</h2>\
         <p class=\"status\"><span aria-hidden=\"true\">{mark}</span> {status}</p>\
         <p class=\"headline\">{}</p><p>{} {}</p></section>\n",
        verdict.title,
        escape(&verdict.headline),
        escape(&verdict.detail),
        escape(&beta)
    )
}

fn statements(record: &Record) -> String {
    format!(
        "<div class=\"words\"><section aria-labelledby=\"claimed\">\
         <h2 id=\"claimed\">What is claimed</h2>\n<ol class=\"statements\">\n{}</ol>\n\
         <p>All claims hold together with confidence 1 − {}.</p></section>\n\
         <section class=\"card limits\" aria-labelledby=\"limits\">\
         <h2 id=\"limits\">What this does not say</h2>\n<ul>\n{}</ul></section></div>\n",
        items(&record.statements),
        upper(record.beta_total),
        items(&limits(record))
    )
}

/// That the disturbances of the model are 0, where it has some.
fn undisturbed(record: &Record) -> Option<String> {
    let names = record.provenance.config.pointer("/model/disturbances")?.as_object()?;
    let names: Vec<&str> = names.keys().map(String::as_str).collect();
    (!names.is_empty()).then(|| {
        format!(
            "It is about the undisturbed plant: {} is 0 in every rollout, whatever its bound.",
            names.join(", ")
        )
    })
}

/// What a reader might take the certificate for, and what it is.
fn limits(record: &Record) -> Vec<String> {
    let given = format!(
        "Nothing is certified for one given state. Each claim is about a measure: how much \
         of what is drawn from it may fail, not which start does. The deviation bound is \
         about {}; the certified set about {}.",
        record.deviation.claim.measure, record.global.claim.measure
    );
    let mut limits = vec![
        record.enclosed.as_ref().map_or(given, |found| enclosed::limit(record, found)),
        format!(
            "Confidence is about the draw of the scenarios: the procedure gives a false \
             certificate with probability at most {}.",
            upper(record.beta_total)
        ),
        "It is about the system as modelled and the policy with the recorded digests, within the \
         horizon; not about the machine that the model stands for."
            .to_owned(),
    ];
    limits.push(attempt(record));
    limits.extend(undisturbed(record));
    if !record.slice.check_margin.is_empty() {
        limits.push(
            "The picture of the slice is made of single rollouts. What lies between two cells was \
             not computed, and the zero lines are interpolated."
                .to_owned(),
        );
    }
    match record.deviation.control {
        PairControl::Replay => limits.push(
            "The deviation bound replays the controls of the nominal rollout: it shows that some \
             controls succeed, not that the policy in feedback gives them."
                .to_owned(),
        ),
        PairControl::ClosedLoop => {}
    }
    if record.deviation.joint == Joint::Separate {
        let used = if record.enclosed.is_none() { ", though V_check uses them so" } else { "" };
        limits.push(format!(
            "The deviation bound was drawn for each step on its own: there is no statement about \
             all steps at once{used}."
        ));
    }
    match (record.growth.outcome, &record.growth.claim) {
        (GrowthOutcome::Verified, Some(claim)) => {
            limits.push(format!(
                "The verified {} is about {}.",
                words::grown(record),
                claim.measure
            ));
        }
        (GrowthOutcome::Exhausted, _) => limits.push(format!(
            "Local growth was exhausted: the last {} tried is drawn, and is not certified.",
            words::grown(record)
        )),
        _ => {}
    }
    limits
}

/// What the certificate counts as among others of the same claims.
fn attempt(record: &Record) -> String {
    match &record.attempt {
        None => "It counts as the only attempt at these claims. Whoever certifies again, with another seed or \
                 changed settings, and shows the better one, draws anew: that is another attempt, and only \
                 `--attempt 2` and on pay for it, on top of all of this one's beta."
            .to_owned(),
        Some(attempt) => format!(
            "It is attempt {} at these claims and books {} of each beta that was asked for; all numbered \
             attempts together book no more than that beta, a first one without a number as much again.",
            attempt.number,
            upper(attempt.share)
        ),
    }
}

fn numbers(record: &Record) -> String {
    format!(
        "<section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <p class=\"hint\">Risks and bounds are rounded up, radii down, intervals outwards. The \
         equations are in <code>docs/method.md</code>, every digit is in \
         <code>certificate.json</code>.</p>\n\
         {}{}<div class=\"tables\">\n{}{}</div>\n{}\
         <details><summary>Deviation bound at each step</summary>\n{}</details>\n\
         {}</section>\n",
        table::claims(record),
        sets::sets(record),
        table::narrow(record) + &enclosed::table(record) + &deterministic::table(record),
        sets::drops(record),
        table::wide(record) + &growth::upward(record) + &sequential::sequential(record),
        table::steps(record),
        shell::configuration(&record.provenance)
    )
}
