//! Sentences computed from the record: what was found, and what that does not say.

use super::front::Front;
use super::grid::{Grid, Point};
use super::readings::{certificate, judged, race, share};
use crate::experiment::record::JudgedRecord;
use crate::experiment::sweep::record::CertificatePoint;
use crate::report::shell::Headline;
use crate::report::text::{count, interval, lower, number, percent, percents, upper};

/// What a sweep came to.
pub(super) struct Findings {
    /// Outcomes that lead the page.
    pub(super) headlines: Vec<Headline>,
    /// What was found, one sentence per fact.
    pub(super) found: Vec<String>,
    /// What a reader might take the results for, and what they are.
    pub(super) limits: Vec<String>,
}

/// The findings of a sweep of races.
pub(super) fn races(grid: &Grid<'_>, front: Option<&Front>) -> Findings {
    let rated: Vec<Rated<'_, '_>> =
        grid.points.iter().filter_map(|p| Rated::new(grid, p)).collect();
    let best = grid.best.and_then(|best| Rated::new(grid, &grid.points[best]));
    let mut findings =
        Findings { headlines: Vec::new(), found: Vec::new(), limits: race_limits(grid) };
    let Some(best) = best else {
        return findings;
    };
    let mut add = |title: &str, of: &Rated<'_, '_>, found: String| {
        findings.headlines.push(of.headline(grid, title));
        findings.found.push(found);
    };
    if rated.iter().all(|one| one.judged.rate == best.judged.rate) && rated.len() > 1 {
        let found = format!("All {} points won {}.", rated.len(), percent(best.judged.rate));
        add("Every point", &best, found);
    } else {
        add("Best point", &best, best_of(grid, &best, rated.len()));
    }
    let overlapping: Vec<_> = rated.iter().filter(|one| one.reaches(&best)).collect();
    let fastest = overlapping.iter().min_by(|a, b| a.milliseconds().total_cmp(&b.milliseconds()));
    let fewest = grid.samples().and_then(|axis| Some((axis, fewest(&overlapping, axis)?)));
    let is_fastest = |one: &Rated<'_, '_>| fastest.is_some_and(|fast| fast.is(one));
    if let Some((axis, one)) = fewest {
        let name = format!("Fewest samples: {}", grid.axes[axis].value(one.point.places[axis]));
        let also = if is_fastest(one) {
            "The fewest samples, and the lowest latency,"
        } else {
            "The fewest samples"
        };
        add(&name, one, overlap(grid, one, also));
    }
    if let Some(one) = fastest.filter(|one| fewest.is_none_or(|(_, few)| !few.is(one))) {
        findings.found.push(overlap(grid, one, "The lowest latency"));
    }
    if let Some(knee) = front.and_then(|front| front.knee.as_ref()) {
        if let Some(knee) = Rated::new(grid, &grid.points[knee.index]) {
            let found = format!("The knee of the Pareto front is {}.", knee.said(grid));
            findings.headlines.push(knee.headline(grid, "Knee of the front"));
            findings.found.push(found);
        }
    }
    findings
}

/// The highest rate among those with the fewest samples.
fn fewest<'r, 'p, 'a>(all: &[&'r Rated<'p, 'a>], axis: usize) -> Option<&'r Rated<'p, 'a>> {
    let place = |one: &&Rated<'_, '_>| one.point.places[axis];
    let least = all.iter().map(place).min()?;
    let few = all.iter().filter(|one| place(one) == least);
    few.copied().max_by(|a, b| a.judged.rate.total_cmp(&b.judged.rate))
}

/// A point with a verdict.
struct Rated<'p, 'a> {
    point: &'p Point<'a>,
    judged: &'a JudgedRecord,
}

impl<'p, 'a> Rated<'p, 'a> {
    fn new(grid: &Grid<'_>, point: &'p Point<'a>) -> Option<Self> {
        let judged = judged(grid.record, point.record)?;
        judged.rate.is_finite().then_some(Self { point, judged })
    }

    /// Whether both are the same point.
    fn is(&self, other: &Self) -> bool {
        self.point.places == other.point.places
    }

    /// Median latency, ms.
    fn milliseconds(&self) -> f64 {
        race(self.point.record).map_or(f64::NAN, |race| 1e3 * race.latency.median_seconds)
    }

    /// Whether its interval overlaps that of the best.
    fn reaches(&self, best: &Self) -> bool {
        self.judged.interval[1] >= best.judged.interval[0]
    }

    /// Name, rate, interval and latency.
    fn said(&self, grid: &Grid<'_>) -> String {
        format!(
            "{}: {} ({}), {} ms a step",
            grid.name(self.point),
            percent(self.judged.rate),
            percents(self.judged.interval),
            number(self.milliseconds())
        )
    }

    fn headline(&self, grid: &Grid<'_>, title: &str) -> Headline {
        Headline {
            title: title.to_owned(),
            value: percent(self.judged.rate),
            details: vec![
                format!("At {}.", grid.name(self.point)),
                format!("95\u{a0}% interval: {}.", percents(self.judged.interval)),
                format!("Median latency {}\u{a0}ms.", number(self.milliseconds())),
            ],
        }
    }
}

fn best_of(grid: &Grid<'_>, best: &Rated<'_, '_>, count: usize) -> String {
    let said = best.said(grid);
    match count {
        1 => format!("The one point that was judged is {said}."),
        _ => format!(
            "The best of {count} points is {said}. The best of many looks better than it is: fly \
             it again from starts that the sweep has not seen."
        ),
    }
}

fn overlap(grid: &Grid<'_>, one: &Rated<'_, '_>, title: &str) -> String {
    format!("{title} whose interval overlaps that of the best point: {}.", one.said(grid))
}

fn race_limits(grid: &Grid<'_>) -> Vec<String> {
    let record = grid.record;
    let starts = record.starts.as_ref().map_or(0, |starts| starts.count);
    let seed = record.noise_seeds.first();
    let seed = seed.map_or_else(String::new, |seed| format!(" with noise seed {seed}"));
    vec![
        format!(
            "Each 95 % interval is of one run of {} races{seed}, at one point. That all of them \
             hold at once is not claimed.",
            count(starts)
        ),
        "Overlapping intervals do not show that two points are equal, and no test was made: all \
         points fly from the same starts with the same noise, which makes their difference less \
         noisy than the intervals suggest."
            .to_owned(),
        format!(
            "Latencies were measured on this backend and device ({}), one race at a time, and \
             differ from run to run; the success rates do not depend on them.",
            record.provenance.backend
        ),
        "Costs of plans with different horizons or cost keys do not compare.".to_owned(),
        "Success rates are measured, not certified.".to_owned(),
    ]
}

/// The findings of a sweep of certificates.
pub(super) fn certificates(grid: &Grid<'_>) -> Findings {
    let all: Vec<(&Point<'_>, &CertificatePoint)> =
        grid.points.iter().filter_map(|point| Some((point, certificate(point.record)?))).collect();
    let mut headlines = Vec::new();
    let mut found = Vec::new();
    if let Some(best) = grid.best {
        let point = &grid.points[best];
        if let Some(certificate) = certificate(point.record) {
            let [low, high] = certificate.share_interval.map(|end| 100.0 * end);
            let name = grid.name(point);
            found.push(format!(
                "The largest share of the box is certified at {name}: {}\u{a0}% ({}\u{a0}%).",
                number(100.0 * share(certificate)),
                interval([low, high])
            ));
            headlines.push(Headline {
                title: "Largest certified share".to_owned(),
                value: format!("{}\u{a0}%", number(100.0 * share(certificate))),
                details: vec![
                    format!("At {name}."),
                    format!("Interval: {}\u{a0}%.", interval([low, high])),
                ],
            });
        }
    }
    let balls = all.iter().filter(|(_, one)| one.radius > 0.0);
    if let Some((point, one)) = balls.max_by(|(_, a), (_, b)| a.radius.total_cmp(&b.radius)) {
        let (name, radius) = (grid.name(point), lower(one.radius));
        found.push(format!("The largest verified ball has radius {radius}, at {name}."));
        headlines.push(Headline {
            title: "Largest verified ball".to_owned(),
            value: format!("radius {radius}"),
            details: vec![format!("At {name}.")],
        });
    } else if !all.is_empty() {
        found.push("Local growth verified no ball at any point.".to_owned());
    }
    if !all.is_empty() {
        let held = all.iter().filter(|(_, one)| one.holds).count();
        found.push(format!(
            "At {held} of {} points every claim that was asked for was obtained.",
            all.len()
        ));
        headlines.push(Headline {
            title: "Every claim obtained".to_owned(),
            value: format!("{held} of {}", all.len()),
            details: vec!["Points whose certificate holds as a whole.".to_owned()],
        });
    }
    Findings { headlines, found, limits: certificate_limits(&all) }
}

fn certificate_limits(all: &[(&Point<'_>, &CertificatePoint)]) -> Vec<String> {
    let total: f64 = all.iter().map(|(_, one)| one.beta_total).sum();
    let together = if total < 1.0 {
        format!(
            "Each certificate has its own confidence. All {} hold together with confidence at \
             least 1 − {}; that is the confidence of the one that is picked after a look at all.",
            all.len(),
            upper(total)
        )
    } else {
        format!(
            "The betas of all {} certificates sum to {}: at 1 and above nothing is said about all \
             of them together, nor about the one that is picked after a look at them.",
            all.len(),
            upper(total)
        )
    };
    vec![
        together,
        "Points with different risks or radii claim different things: a larger share is not a \
         better certificate by itself."
            .to_owned(),
        "Nothing is certified for one given state: each claim is about a measure.".to_owned(),
    ]
}
