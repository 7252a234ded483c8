//! The page of plans in closed loop: what came of the runs, the plan in time, and every number.

use super::figure::Figure;
use super::plan_figures::figures;
use super::plan_paths;
use super::plan_runs::PlanPage;
use super::shell::{self, Headline, Scripts};
use super::table::{pairs, table};
use super::text::{capital, count, escape, interval, lower, number, or_dash, percents, upper};
use crate::model::Form;
use crate::plan::PlanRecord;
use crate::plan::record::{LatencyRecord, RunRecord, SuccessRecord, TermRecord};
use crate::rollout::NoiseKind;

/// The report of plans in closed loop as one HTML document that loads nothing from anywhere.
pub fn plan_html(page: &PlanPage<'_>) -> String {
    let record = page.record;
    let figures: Vec<Figure> = plan_paths::figure(page).into_iter().chain(figures(page)).collect();
    let figures: String = figures.iter().map(Figure::html).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body>\n{hatch}{header}<main>\n{notes}\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">The plan in time</h2>\n\
         <div class=\"gallery flow\">\n{figures}</div></section>\n\
         <section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <div class=\"tables\">\n{narrow}</div>\n{runs}{configuration}</section>\n\
         {adapter}</main>\n{footer}</body>\n</html>\n",
        head = shell::head("plans in closed loop", shell::SHEET_STYLE, Scripts::None),
        hatch = shell::HATCH,
        header = header(record),
        notes = shell::notes(&record.notes.iter().map(|note| sentence(note)).collect::<Vec<_>>()),
        narrow = narrow(record),
        runs = runs(record),
        configuration = shell::configuration(&record.provenance),
        adapter = shell::failures(&record.events),
        footer = shell::footer(
            &record.provenance,
            "a second run with this seed on such a machine gives the same page but for the times"
        ),
    )
}

/// `note` with a capital letter and a full stop; names in quotes stay as they are.
fn sentence(note: &str) -> String {
    capital(note) + "."
}

/// What came of the runs.
fn header(record: &PlanRecord) -> String {
    let cards: String =
        [success(record), cost(record), latency(record)].iter().map(shell::card).collect();
    let provenance = &record.provenance;
    let line = format!(
        "MPPI, {}, seed {}; {}; reachcast {}.",
        provenance.policy, provenance.seed, provenance.device, provenance.version
    );
    format!(
        "<header>\n<p class=\"brand\">Reachcast plan</p>\n<h1>{}</h1>\n\
         <p class=\"policy\">{}</p>\n<div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&record.system.name),
        escape(&line)
    )
}

fn success(record: &PlanRecord) -> Headline {
    let SuccessRecord { successes, runs, interval, of, .. } = &record.success;
    let words = record.system.task.words(Form::One, record.steps);
    Headline {
        title: "Runs that succeed".to_owned(),
        value: format!("{} of {}", count(*successes), count(*runs)),
        details: vec![
            format!("A run succeeds if it {words}."),
            format!("95 % interval of the share: {}, over {of}.", percents(*interval)),
        ],
    }
}

fn cost(record: &PlanRecord) -> Headline {
    let term = |term: &TermRecord| format!("{}: {}.", term.key(), number(term.mean));
    Headline {
        title: "Cost of a run, mean".to_owned(),
        value: number(record.cost.mean),
        details: record.cost.terms.iter().map(term).collect(),
    }
}

fn latency(record: &PlanRecord) -> Headline {
    let LatencyRecord { plans, median, p95, most, .. } = record.latency;
    let together = match plans {
        1 => "One plan is improved at each step.".to_owned(),
        _ => format!("{plans} plans are improved together at each step."),
    };
    let spread =
        format!("95 % of the steps within {} ms, all within {} ms.", upper(p95), upper(most));
    Headline {
        title: "A control step, median".to_owned(),
        value: format!("{} ms", upper(median)),
        details: vec![spread, together],
    }
}

/// The tables of two columns.
fn narrow(record: &PlanRecord) -> String {
    [plans(record), outcome(record), times(record), provenance(record)].concat()
}

fn plans(record: &PlanRecord) -> String {
    let plans = &record.plans;
    let noise = match plans.noise {
        NoiseKind::Independent => "independent at each step".to_owned(),
        NoiseKind::Colored { time } => format!("colored, correlated over {time} steps"),
        NoiseKind::Spline { knots } => format!("a spline through {knots} knots"),
    };
    let flag = |flag: bool| if flag { "yes" } else { "no" }.to_owned();
    let rows: Vec<String> = plans.sigma.iter().map(|row| format!("{row:?}")).collect();
    pairs(
        "Plans",
        &[
            ("samples K", count(plans.samples.into())),
            ("steps of a plan H", plans.horizon.to_string()),
            ("improvements at each step", plans.iterations.to_string()),
            ("temperature lambda", number(plans.temperature.into())),
            ("noise, sigma", rows.join(", ")),
            ("noise over the steps", noise),
            ("mirrored pairs", flag(plans.antithetic)),
            ("samples pay for their noise", flag(plans.noise_cost)),
            ("first plan", format!("{:?}", plans.first_plan).to_lowercase()),
        ],
    )
}

fn outcome(record: &PlanRecord) -> String {
    let terms = record.cost.terms.iter();
    let terms: Vec<(String, String)> = terms.map(|term| (term.key(), number(term.mean))).collect();
    let terms = terms.iter().map(|(name, value)| (name.as_str(), value.clone()));
    let success = &record.success;
    let rows = [
        ("runs", count(success.runs)),
        ("runs that succeed", count(success.successes)),
        ("95 % interval (Clopper-Pearson)", interval(success.interval)),
        ("steps of a run", count(record.steps.into())),
        ("seconds of a step", or_dash(record.period)),
        ("discount gamma", number(record.gamma.into())),
        ("cost of a run, mean", number(record.cost.mean)),
    ];
    let effective = [
        ("effective samples, median", lower(record.effective.median)),
        ("effective samples, fewest", lower(record.effective.least)),
    ];
    pairs("Runs", &rows.into_iter().chain(terms).chain(effective).collect::<Vec<_>>())
}

fn times(record: &PlanRecord) -> String {
    let LatencyRecord { plans, median, p95, most, first } = record.latency;
    let milliseconds = |time: f64| format!("{} ms", upper(time));
    pairs(
        "A control step",
        &[
            ("plans improved together", plans.to_string()),
            ("median", milliseconds(median)),
            ("95 % of the steps within", milliseconds(p95)),
            ("longest", milliseconds(most)),
            ("the first one", milliseconds(first)),
        ],
    )
}

fn provenance(record: &PlanRecord) -> String {
    let provenance = &record.provenance;
    pairs(
        "Provenance",
        &[
            ("reachcast", provenance.version.clone()),
            ("layout of the record", record.schema.to_string()),
            ("seed", provenance.seed.to_string()),
            ("generator", provenance.generator.clone()),
            ("backend", provenance.backend.clone()),
            ("device", provenance.device.clone()),
            ("model SHA-256", provenance.physics_sha256.clone()),
            ("costs SHA-256", provenance.policy_sha256.clone()),
        ],
    )
}

/// A row for each run.
fn runs(record: &PlanRecord) -> String {
    let head = ["run", "outcome", "measure", "done at step", "cost"].map(str::to_owned);
    let terms = record.cost.terms.iter().map(TermRecord::key);
    let last = ["effective samples, median", "stopped"].map(str::to_owned);
    let head: Vec<String> = head.into_iter().chain(terms).chain(last).collect();
    let row = |(number_of, run): (usize, &RunRecord)| {
        let outcome = if run.success { "succeeds" } else { "fails" };
        let stopped = run.stopped.as_ref();
        let stopped = stopped.map(|stopped| format!("step {}: {}", stopped.step, stopped.reason));
        let first = [
            number_of.to_string(),
            outcome.to_owned(),
            number(run.measure),
            or_dash(run.reached),
            number(run.cost),
        ];
        let terms = run.terms.iter().map(|term| number(*term));
        let last = [lower(run.effective.median), or_dash(stopped)];
        first.into_iter().chain(terms).chain(last).collect()
    };
    let rows = record.runs.iter().enumerate().map(row);
    table("Every run", &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}
