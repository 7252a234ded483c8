//! The page of a sweep: what was found, figures over the grid, and every point in a table.

mod chart;
mod curves;
mod failures;
mod findings;
mod front;
mod grid;
mod heat;
mod lines;
mod pareto;
mod readings;
mod rows;
mod table;

use crate::race::page::verdicts::Ceiling;
use crate::race::sweep::record::{AxisRecord, SweepRecord};
use crate::report::figure::Figure;
use crate::report::palette;
use crate::report::shell::{self, HATCH, SHEET_STYLE, Scripts, WEAVES, items};
use crate::report::sortable::SCRIPT;
use crate::report::text::{count, counted, escape, listed, most_percent, shorten};
use findings::Findings;
use front::Front;
use grid::Grid;

const SWEEP_STYLE: &str = include_str!("sweep.css");
/// Values of an axis that the header lists.
const LISTED: usize = 12;
/// Characters of a value in the header.
const VALUE: usize = 40;

/// The report of a sweep as one HTML document that loads nothing from anywhere.
///
/// It depends on the record alone, so equal records give equal pages byte for byte. One inline
/// script sorts the table of points; without it the table is in the order of the grid.
pub fn sweep_html(record: &SweepRecord) -> String {
    let grid = Grid::new(record);
    let (figures, findings) = if of_certificates(record) {
        (certificate_figures(&grid), findings::certificates(&grid))
    } else {
        let front = Front::new(&grid);
        (race_figures(&grid, front.as_ref()), findings::races(&grid, front.as_ref()))
    };
    let styles = format!("{}{SHEET_STYLE}{SWEEP_STYLE}", palette::rules());
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body class=\"sweep\">\n{HATCH}{WEAVES}{header}\
         <main>\n{body}</main>\n{footer}<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        head = shell::head("sweep", &styles, Scripts::Own),
        header = header(record, &findings),
        body = body(&grid, &figures, &findings),
        footer =
            shell::footer(&record.provenance, "latencies and wall times differ from run to run"),
    )
}

/// Whether the points are certificates; a sweep without points is one of races if it has starts.
fn of_certificates(record: &SweepRecord) -> bool {
    match record.points.first() {
        Some(point) => readings::certificate(point).is_some(),
        None => record.starts.is_none(),
    }
}

fn race_figures(grid: &Grid<'_>, front: Option<&Front>) -> Vec<Figure> {
    let ceiling = readings::ceiling(grid.record).map(|ceiling| ceiling.share);
    let mut figures = vec![
        chart::figure(grid, &readings::SUCCESS, ceiling),
        chart::figure(grid, &readings::LATENCY, None),
        pareto::figure(grid, front, ceiling),
    ];
    figures.extend(heat::figure(grid, &readings::SUCCESS));
    figures.extend(failures::figure(grid));
    figures
}

fn certificate_figures(grid: &Grid<'_>) -> Vec<Figure> {
    let measures =
        [&readings::SHARE, &readings::SCENARIOS, &readings::DEVIATION, &readings::GROWTH];
    let mut figures: Vec<_> =
        measures.into_iter().map(|measure| chart::figure(grid, measure, None)).collect();
    figures.extend(heat::figure(grid, &readings::SHARE));
    figures
}

fn header(record: &SweepRecord, findings: &Findings) -> String {
    let cards: String = findings.headlines.iter().map(shell::card).collect();
    let axes: String = record.axes.iter().map(axis).collect();
    let kind = if of_certificates(record) { "certificates" } else { "races" };
    format!(
        "<header>\n<p class=\"brand\">Reachcast sweep of {kind}</p>\n<h1>{}</h1>\n{}\
         <dl class=\"described\">{axes}</dl>\n<p class=\"policy\">{}</p>\n\
         <div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&title(record)),
        progress(record),
        escape(&setting(record)),
    )
}

fn title(record: &SweepRecord) -> String {
    let varying = record.axes.iter().filter(|axis| axis.values.len() > 1);
    let names: Vec<_> = varying.map(|axis| shorten(&axis.name, VALUE)).collect();
    let points = counted(record.points.len(), "point", "points");
    match names.is_empty() {
        true => points,
        false => format!("{points} over {}", listed(&names)),
    }
}

/// That the sweep is not done, where it is not.
fn progress(record: &SweepRecord) -> String {
    let done = record.points.len() as u64;
    if done >= record.total {
        return String::new();
    }
    format!(
        "<p class=\"verdict bad\">{} of {} points are done: the sweep is under way or was \
         interrupted.</p>\n",
        count(done),
        count(record.total)
    )
}

/// A parameter and the values that it takes.
fn axis(axis: &AxisRecord) -> String {
    let mut values: Vec<_> =
        axis.values.iter().take(LISTED).map(|value| shorten(value, VALUE)).collect();
    if axis.values.len() > LISTED {
        values.push(format!("{} more", axis.values.len() - LISTED));
    }
    format!("<dt>{}</dt><dd>{}</dd>", escape(&axis.name), escape(&listed(&values)))
}

/// What every point has in common.
fn setting(record: &SweepRecord) -> String {
    let provenance = &record.provenance;
    let starts = record.starts.as_ref().map_or_else(String::new, |starts| {
        let seeds: Vec<_> = record.noise_seeds.iter().map(u64::to_string).collect();
        let seeds = match seeds.len() {
            0 => String::new(),
            1 => format!(" with noise seed {}", seeds[0]),
            _ => format!(" with noise seeds {}", listed(&seeds)),
        };
        let starts = format!("{} starts ({})", count(starts.count), starts.source);
        format!("Every point flies the same {starts}{seeds}. ")
    });
    let judge = record.judge.map_or_else(String::new, |judge| {
        let ceiling =
            readings::ceiling(record).map_or_else(String::new, |Ceiling { safe, share }| {
                let starts = counted(safe as usize, "start is", "starts are");
                format!(
                    ", under which {starts} safe before anyone moves: at most {}",
                    most_percent(share)
                )
            });
        format!("The judge is {}{ceiling}. ", judge.name())
    });
    format!(
        "{starts}{judge}Backend {}, {}; seed {}; reachcast {}. Policy: {}.",
        provenance.backend,
        provenance.device,
        provenance.seed,
        provenance.version,
        provenance.policy
    )
}

fn body(grid: &Grid<'_>, figures: &[Figure], findings: &Findings) -> String {
    if grid.points.is_empty() {
        let empty = "<p class=\"empty\">No point is done yet.</p>\n";
        return format!("{empty}{}", numbers(grid));
    }
    let figures: String = figures.iter().map(Figure::html).collect();
    let found = match findings.found.is_empty() {
        true => "<p>No point was judged.</p>".to_owned(),
        false => format!("<ol class=\"statements\">\n{}</ol>", items(&findings.found)),
    };
    format!(
        "<div class=\"words\"><section aria-labelledby=\"found\">\
         <h2 id=\"found\">What was found</h2>\n{found}</section>\n\
         <section class=\"card limits\" aria-labelledby=\"limits\">\
         <h2 id=\"limits\">What this does not say</h2>\n<ul>\n{}</ul></section></div>\n{}\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">Pictures</h2>\n\
         <div class=\"gallery\">\n{figures}</div></section>\n{}",
        items(&findings.limits),
        shell::failures(&grid.record.events()) + &shell::notes(&grid.record.notes),
        numbers(grid)
    )
}

fn numbers(grid: &Grid<'_>) -> String {
    format!(
        "<section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <p class=\"hint\">A heading sorts the table by its column, once more the other way round. \
         Intervals are rounded outwards, risks up, radii down. Every digit is in \
         <code>sweep.csv</code>, <code>sweep.parquet</code> and <code>sweep.json</code>.</p>\n\
         {}<div class=\"tables\">\n{}</div>\n{}</section>\n",
        if grid.points.is_empty() { String::new() } else { table::points(grid) },
        table::narrow(grid.record),
        shell::configuration(&grid.record.provenance)
    )
}
