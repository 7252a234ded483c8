//! The page of a run of training: what came of it, its learning curves, and where it came from.

use super::figure::{Figure, Swatch};
use super::plot::{Labels, Plot, Proportions};
use super::shell::{self, Headline, Scripts};
use super::span::Span;
use super::table::{across_page, pairs, table};
use super::text::{capital, count, escape, number, or_dash, ordinary};
use crate::train::record::{CurvePoint, TrainRecord};

/// How scores that are shares begin.
const SHARE: &str = "share";
/// What a share lies between.
const SHARES: Span = Span { low: 0.0, high: 1.0 };
/// Marks the networks that were kept.
const BEST: &str = "<circle class=\"seen\" r=\"4\"/>";

/// The report of a run of training as one HTML document that loads nothing from anywhere.
///
/// It depends on the record alone, so equal records give equal pages byte for byte.
pub fn train_html(record: &TrainRecord) -> String {
    let provenance = &record.origin.provenance;
    let figures: String = figures(record).iter().map(Figure::html).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n{head}<body>\n{header}<main>\n\
         <section aria-labelledby=\"figures\"><h2 id=\"figures\">Learning curves</h2>\n\
         <div class=\"gallery\">\n{figures}</div></section>\n\
         {notes}{policy}<section aria-labelledby=\"numbers\"><h2 id=\"numbers\">Numbers</h2>\n\
         <div class=\"tables\">\n{numbers}</div>\n{rows}{configuration}</section>\n\
         {adapter}</main>\n{footer}</body>\n</html>\n",
        head = shell::head(&format!("training{}", shell::of_plant(provenance)), "", Scripts::None),
        header = header(record),
        notes = shell::notes(&record.notes),
        policy = policy(record),
        numbers = numbers(record),
        rows = rows(record),
        configuration = shell::configuration(provenance),
        adapter = shell::failures(&record.events),
        footer = shell::footer(provenance, "a second run on such a machine gives the same page"),
    )
}

/// How the policy is used, where it is that of a model as text.
fn policy(record: &TrainRecord) -> String {
    record.policy.as_ref().map_or_else(String::new, |section| {
        format!(
            "<section aria-labelledby=\"use\"><h2 id=\"use\">Using the policy</h2>\n\
             <p>The configuration of the model uses it with this section, the file beside it:</p>\n\
             <pre tabindex=\"0\">{}</pre></section>\n",
            escape(section)
        )
    })
}

/// The scores of the networks that were kept.
fn header(record: &TrainRecord) -> String {
    let best = best(record);
    let cards: String = record
        .scores
        .iter()
        .enumerate()
        .map(|(i, name)| {
            let value = best.and_then(|point| point.scores.get(i).copied());
            shell::card(&Headline {
                title: name.clone(),
                value: or_dash(value.map(number)),
                details: vec![after(record)],
            })
        })
        .collect();
    let provenance = &record.origin.provenance;
    let line = format!(
        "Method {}, seed {}; {}, {}; reachcast {}.",
        record.origin.method.name(),
        provenance.seed,
        provenance.policy,
        provenance.device,
        provenance.version
    );
    format!(
        "<header>\n<p class=\"brand\">Reachcast training</p>\n<h1>{}</h1>\n\
         <p class=\"policy\">{}</p>\n<div class=\"cards\">\n{cards}</div>\n</header>\n",
        escape(&(title(record) + &shell::of_plant(provenance))),
        escape(&line),
    )
}

fn title(record: &TrainRecord) -> String {
    let names: Vec<_> = record.networks.iter().map(|network| network.file.as_str()).collect();
    names.join(", ")
}

/// When the networks that were kept were reached, and how the run ended.
fn after(record: &TrainRecord) -> String {
    let end = match record.stopped_early {
        true => format!(" It ended early, after {}.", count(done(record))),
        false => String::new(),
    };
    let (best, total) = (count(record.best), count(record.total));
    format!("Reached after {best} of {total} iterations.{end}")
}

/// The score of the networks that were kept.
fn best(record: &TrainRecord) -> Option<&CurvePoint> {
    record.curve.iter().find(|point| point.iteration == record.best)
}

/// Iterations done.
fn done(record: &TrainRecord) -> u64 {
    record.curve.last().map_or(0, |point| point.iteration)
}

/// A figure for each score and one for the loss.
fn figures(record: &TrainRecord) -> Vec<Figure> {
    let ids = ["score", "second-score", "third-score", "fourth-score"];
    let scores = ids.into_iter().zip(&record.scores).enumerate().map(|(i, (id, name))| {
        let read = move |point: &CurvePoint| point.scores.get(i).copied();
        let caption = "Computed by the engine on what the network was never trained on; the mark \
                       is the network that was kept.";
        curve(record, id, name, caption, &read)
    });
    let caption = "Mean over the updates between two scores. Its scale moves with the settings of \
                   the method, such as a temperature that falls; the score above decides.";
    let loss = curve(record, "loss", "loss", caption, &|point| point.loss);
    scores.chain([loss]).collect()
}

/// A number of each score against the iterations.
fn curve(
    record: &TrainRecord,
    id: &'static str,
    name: &str,
    caption: &str,
    read: &dyn Fn(&CurvePoint) -> Option<f64>,
) -> Figure {
    let place = |point: &CurvePoint| [point.iteration as f64, read(point).unwrap_or(f64::NAN)];
    let points: Vec<[f64; 2]> = record.curve.iter().map(place).collect();
    let drawing = match Span::of(points.iter().map(|[_, value]| *value)) {
        None => Err("Nothing of this was measured.".to_owned()),
        Some(values) => {
            let across = Span { low: 0.0, high: done(record).max(1) as f64 };
            let up = if is_share(name, values) { SHARES } else { values.opened() };
            let mut plot = Plot::new(id, across, up.widened(0.08), Proportions::Free(250.0));
            let line = plot.line(points.iter().copied());
            plot.path("bound", &line);
            if let Some(kept) = best(record) {
                plot.mark(place(kept), BEST);
            }
            let labels = Labels { x: "iterations", y: short(name), whole: true };
            Ok(plot.finish(&labels, &format!("{name} against the iterations")))
        }
    };
    let kept = best(record).and_then(read).is_some_and(ordinary);
    let kept = kept.then(|| (Swatch::Mark(BEST.to_owned()), "kept".to_owned()));
    let mut legend = Vec::new();
    if drawing.is_ok() {
        legend.push((Swatch::Line("bound"), name.to_owned()));
        legend.extend(kept);
    }
    Figure { id, title: capital(name), drawing, legend, caption: caption.to_owned() }
}

/// Whether a score is a share: it is called one, and goes no further than one can.
fn is_share(name: &str, values: Span) -> bool {
    name.starts_with(SHARE) && values.low >= SHARES.low && values.high <= SHARES.high
}

/// What an axis of `name` is called; the title of the figure has the whole.
fn short(name: &str) -> &str {
    name.split([',', '(']).next().filter(|_| !name.starts_with(SHARE)).unwrap_or(SHARE).trim()
}

/// Every number of the record but the curves.
fn numbers(record: &TrainRecord) -> String {
    let provenance = &record.origin.provenance;
    let mut networks = vec![["file", "neurons per layer", "SHA-256"].map(str::to_owned).to_vec()];
    networks.extend(record.networks.iter().map(|network| {
        let widths: Vec<_> = network.widths.iter().map(usize::to_string).collect();
        vec![network.file.clone(), widths.join("-"), network.sha256.clone()]
    }));
    let origin = [
        ("method", record.origin.method.name().to_owned()),
        ("schema", record.schema.to_string()),
        ("seed", provenance.seed.to_string()),
        ("generator", provenance.generator.clone()),
        ("policy it began with", provenance.policy.clone()),
        ("SHA-256 of that policy", provenance.policy_sha256.clone()),
        ("SHA-256 of the physics", provenance.physics_sha256.clone()),
        ("backend", provenance.backend.clone()),
        ("device", provenance.device.clone()),
        ("version", provenance.version.clone()),
    ];
    table("Networks", &networks) + &pairs("Origin", &origin)
}

/// The curves in numbers.
fn rows(record: &TrainRecord) -> String {
    let head = ["iterations", "loss"].into_iter().map(str::to_owned);
    let mut rows = vec![head.chain(record.scores.iter().cloned()).collect::<Vec<_>>()];
    rows.extend(record.curve.iter().map(|point| {
        let cells = [count(point.iteration), or_dash(point.loss.map(number))];
        cells.into_iter().chain(point.scores.iter().map(|score| number(*score))).collect()
    }));
    across_page("Curve", &rows)
}
