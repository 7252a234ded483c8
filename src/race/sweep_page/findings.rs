//! Sentences computed from the record: what was found, and what that does not say.

use super::front::Front;
use super::grid::{Grid, Point};
use super::readings::{certificate, judged, race, share};
use crate::race::record::JudgedRecord;
use crate::race::sweep::record::CertificatePoint;
use crate::report::shell::Headline;
use crate::report::text::{count, lower, number, percent, percents, upper};
use crate::scenario::ledger::total;

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
    let mut findings =
        Findings { headlines: Vec::new(), found: Vec::new(), limits: race_limits(grid) };
    let all: Vec<_> = grid.points.iter().filter_map(|point| Rated::new(grid, point)).collect();
    let Some(best) = grid.best.and_then(|best| Rated::new(grid, &grid.points[best])) else {
        return findings;
    };
    if all.len() > 1 && all.iter().all(|one| one.judged.rate == best.judged.rate) {
        let rate = percent(best.judged.rate);
        findings.add(
            best.headline(grid, "Every point"),
            format!("All {} points won {rate}.", all.len()),
        );
        return findings;
    }
    let title = if all.len() == 1 { "The one point" } else { "Best point" };
    findings.add(best.headline(grid, title), best_of(grid, &best, all.len()));
    if all.len() > 1 {
        let overlapping: Vec<_> = all.iter().filter(|one| one.reaches(&best)).collect();
        overlaps(grid, &overlapping, &mut findings);
    }
    let knee = front.and_then(|front| front.knee.as_ref());
    if let Some(knee) = knee.and_then(|knee| Rated::new(grid, &grid.points[knee.index])) {
        let found = format!("The knee of the Pareto front is {}.", knee.said(grid));
        findings.add(knee.headline(grid, "Knee of the front"), found);
    }
    findings
}

impl Findings {
    fn add(&mut self, headline: Headline, found: String) {
        self.headlines.push(headline);
        self.found.push(found);
    }
}

/// The cheapest of the points whose interval overlaps that of the best: by samples, by latency.
fn overlaps(grid: &Grid<'_>, all: &[&Rated<'_, '_>], findings: &mut Findings) {
    let fastest = all.iter().min_by(|a, b| a.milliseconds().total_cmp(&b.milliseconds()));
    let fewest = grid.samples().and_then(|axis| Some((axis, fewest(all, axis)?)));
    let same = fewest.zip(fastest).is_some_and(|((_, few), fast)| few.is(fast));
    let found = |which: &str, one: &Rated<'_, '_>| {
        let said = one.said(grid);
        format!("{which} whose interval overlaps that of the best point: {said}.")
    };
    if let Some((axis, one)) = fewest {
        let also = if same { ", and the lowest latency," } else { "" };
        let samples = grid.axes[axis].value(one.point.places[axis]);
        let headline = one.headline(grid, &format!("Fewest samples: {samples}"));
        findings.add(headline, found(&format!("The fewest samples{also}"), one));
    }
    if let Some(one) = fastest.filter(|_| !same) {
        findings.found.push(found("The lowest latency", one));
    }
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

/// A point with its certificate.
struct Certified<'p, 'a> {
    point: &'p Point<'a>,
    certificate: &'a CertificatePoint,
}

/// The findings of a sweep of certificates.
pub(super) fn certificates(grid: &Grid<'_>) -> Findings {
    let all: Vec<Certified<'_, '_>> = grid.points.iter().filter_map(certified).collect();
    let parts = [largest_share(grid, &all), largest_ball(grid, &all), held(&all)];
    let (headlines, found) = parts.into_iter().flatten().unzip();
    Findings { headlines, found, limits: certificate_limits(&all) }
}

fn certified<'p, 'a>(point: &'p Point<'a>) -> Option<Certified<'p, 'a>> {
    Some(Certified { point, certificate: certificate(point.record)? })
}

/// The point with the largest share of those whose certificates hold, of all where none does.
fn largest_share(grid: &Grid<'_>, all: &[Certified<'_, '_>]) -> Option<(Headline, String)> {
    let some_hold = all.iter().any(|one| one.certificate.holds);
    let eligible = || all.iter().filter(|one| one.certificate.holds || !some_hold);
    let of = |one: &Certified<'_, '_>| share(one.certificate);
    // Of equal points the first.
    let best = eligible().reduce(|best, next| if of(next) > of(best) { next } else { best })?;
    let (name, value) = (grid.name(best.point), percent(of(best)));
    let interval = percents(best.certificate.share_interval);
    let risk = upper(best.certificate.conditional_risk);
    let mut found = format!(
        "The largest share of the box is certified at {name}: {value} ({interval}), with a failure risk of at \
         most {risk}."
    );
    let mut details = vec![
        format!("At {name}."),
        format!("Interval: {interval}."),
        format!("Failure risk in the set: at most {risk}."),
    ];
    let equal = eligible().filter(|one| of(one) == of(best)).count();
    details.extend((equal > 1).then(|| format!("The same at {} more points.", equal - 1)));
    if !some_hold {
        details.push("No certificate of the sweep holds.".to_owned());
    } else if all.iter().any(|one| of(one) > of(best)) {
        found += " Larger ones belong to certificates that do not hold.";
    }
    details.extend(picked(all));
    Some((Headline { title: "Largest certified share".to_owned(), value, details }, found))
}

fn largest_ball(grid: &Grid<'_>, all: &[Certified<'_, '_>]) -> Option<(Headline, String)> {
    let balls = all.iter().filter(|one| one.certificate.radius > 0.0);
    let radius = |one: &Certified<'_, '_>| one.certificate.radius;
    // Of equal sets the first.
    let largest = balls.reduce(|best, next| if radius(next) > radius(best) { next } else { best });
    let title = "Largest verified set".to_owned();
    let Some(largest) = largest else {
        let found = "Local growth verified no set at any point.".to_owned();
        let headline = Headline { title, value: "none".to_owned(), details: Vec::new() };
        return (!all.is_empty()).then_some((headline, found));
    };
    let equal = all.iter().filter(|one| radius(one) == radius(largest)).count() - 1;
    let (name, radius) = (grid.name(largest.point), lower(radius(largest)));
    let also = if equal > 0 { format!(" and {equal} more") } else { String::new() };
    let found = format!("The largest verified set has radius {radius}, at {name}{also}.");
    let mut details = vec![format!("At {name}{also}.")];
    details.extend(picked(all));
    Some((Headline { title, value: format!("radius {radius}"), details }, found))
}

/// That a point was picked after a look at all of them, with the beta that covers the choice; nothing of a
/// single point.
fn picked(all: &[Certified<'_, '_>]) -> Option<String> {
    let total: f64 = all.iter().map(|one| one.certificate.beta_total).sum();
    let count = all.len();
    let covered = if total < 1.0 {
        format!("beta {} covers the choice.", upper(total))
    } else {
        "their betas sum to 1 or more, so nothing covers the choice.".to_owned()
    };
    (count > 1).then(|| format!("Picked after a look at {count} points: {covered}"))
}

fn held(all: &[Certified<'_, '_>]) -> Option<(Headline, String)> {
    let (held, count) = (all.iter().filter(|one| one.certificate.holds).count(), all.len());
    let found = format!("At {held} of {count} points every claim that was asked for was obtained.");
    let headline = Headline {
        title: "Every claim obtained".to_owned(),
        value: format!("{held} of {count}"),
        details: vec!["Points whose certificate holds as a whole.".to_owned()],
    };
    (count > 0).then_some((headline, found))
}

fn certificate_limits(all: &[Certified<'_, '_>]) -> Vec<String> {
    let total = total(all.iter().map(|one| one.certificate.beta_total));
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
        "Each point takes the policy that its configuration names; none is trained anew."
            .to_owned(),
    ]
}
