//! Sentences computed from the record: what was found, and what that does not say.

use super::verdicts::Ceiling;
use super::words::{self, points};
use crate::race::judge::Judge;
use crate::race::record::{ControllerRecord, JudgedRecord, RaceRecord};
use crate::report::shell::Headline;
use crate::report::text::{count, counted, listed, minus, most_percent, percent, percents, upper};

/// One headline per judge that judged the leading controller.
pub(super) fn headlines(record: &RaceRecord) -> Vec<Headline> {
    let Some(lead) = words::lead(record) else {
        return Vec::new();
    };
    let headline = |judge| {
        let judged = words::judged(lead, judge)?;
        Some(Headline {
            title: format!("{} under the {} judge", lead.name, judge.name()),
            value: percent(judged.rate),
            details: details(record, judged),
        })
    };
    words::judges(record).into_iter().filter_map(headline).collect()
}

fn details(record: &RaceRecord, judged: &JudgedRecord) -> Vec<String> {
    let interval = percents(judged.interval);
    let mut details = match judged.successes.len() {
        0 | 1 => vec![format!("95\u{a0}% interval: {interval}.")],
        seeds => vec![
            format!("Mean over {seeds} noise seeds."),
            format!("95\u{a0}% interval, first seed: {interval}."),
        ],
    };
    if let Some(published) = &judged.published {
        let rate = percent(published.rate);
        details.push(format!("Published: {rate} ({}).", percents(published.interval)));
    }
    if let Some(Ceiling { safe, share }) = words::ceiling(record, judged.judge) {
        let starts = count(record.starts.count);
        details.push(format!(
            "Ceiling: {}; {} of {starts} starts are safe before anyone moves.",
            most_percent(share),
            count(safe)
        ));
    }
    details
}

/// What was found, one sentence per fact.
pub(super) fn found(record: &RaceRecord) -> Vec<String> {
    let mut found = Vec::new();
    for judge in words::judges(record) {
        found.extend(published(record, judge));
        found.extend(runner_up(record, judge));
    }
    found.extend(record.controllers.iter().filter_map(growth));
    found
}

/// Whether the published rates lie inside the intervals found here.
fn published(record: &RaceRecord, judge: Judge) -> Option<String> {
    let (mut inside, mut below, mut above) = (Vec::new(), Vec::new(), Vec::new());
    for (controller, judged) in words::verdicts(record, judge) {
        let Some(published) = &judged.published else { continue };
        let [low, high] = judged.interval;
        let list = match published.rate {
            rate if rate > high => &mut below,
            rate if rate < low => &mut above,
            _ => &mut inside,
        };
        list.push(controller.name.clone());
    }
    let part = |names: &[String], says: &str| {
        (!names.is_empty()).then(|| format!("{says} {}", listed(names)))
    };
    let parts: Vec<_> = [
        part(&inside, "inside the interval of"),
        part(&below, "above that of"),
        part(&above, "below that of"),
    ]
    .into_iter()
    .flatten()
    .collect();
    let judge = judge.name();
    (!parts.is_empty())
        .then(|| format!("Under the {judge} judge the published rate lies {}.", parts.join("; ")))
}

/// The best of the others, beside the leading controller.
fn runner_up(record: &RaceRecord, judge: Judge) -> Option<String> {
    let lead = words::lead(record)?;
    let others = words::verdicts(record, judge).filter(|(other, _)| other.name != lead.name);
    let (best, judged) = others.max_by(|(_, a), (_, b)| a.rate.total_cmp(&b.rate))?;
    let paired = judged.against_hybrid.as_ref().map_or_else(String::new, |paired| {
        format!(
            ", {} points against the hybrid on the same starts ({}; \
             p\u{a0}=\u{a0}{})",
            points(paired.difference),
            words::point_interval(paired.interval),
            minus(&upper(paired.p_value))
        )
    });
    let rate = percent(judged.rate);
    let judge = judge.name();
    Some(format!(
        "The best of the others under the {judge} judge is {}: {rate}{paired}.",
        best.name
    ))
}

/// What local growth achieved for a controller.
fn growth(controller: &ControllerRecord) -> Option<String> {
    let tiers = controller.tiers.as_ref().filter(|tiers| tiers.growth_calls > 0)?;
    let share = tiers.growth_verified as f64 / tiers.growth_calls as f64;
    Some(format!(
        "{}: {} of {} calls of local growth ended with a verified ball ({}).",
        controller.name,
        count(tiers.growth_verified),
        count(tiers.growth_calls),
        percent(share)
    ))
}

/// What a reader might take the results for, and what they are.
pub(super) fn limits(record: &RaceRecord) -> Vec<String> {
    let mut limits = vec![runs(record), seeds(record)];
    limits.push(
        "All controllers fly with the same control noise from the same starts, which the paired \
         comparisons rely on."
            .to_owned(),
    );
    limits.push(
        "A certificate guarantees what its statement says about the measure that it was drawn \
         from. It is not a success rate, and the success rates are not certified."
            .to_owned(),
    );
    limits.extend(record.controllers.iter().filter_map(beta));
    if words::judges(record).contains(&Judge::Study) {
        limits.push(
            "The cone of the study judge grows with the height of the ego above the opponent, \
             that of the constraint with the height of the opponent above the ego: the opposite \
             sign. A certificate for the constraint says nothing about the cone of the study \
             judge."
                .to_owned(),
        );
    }
    limits.extend(comparisons(record));
    if record.controllers.iter().any(|controller| controller.metrics.is_some()) {
        limits.push(
            "Times, paths and distances are means over the races that each controller won: \
             different races for different controllers."
                .to_owned(),
        );
    }
    if record.picture.is_some() {
        limits.push("The race that is shown is one of many, not a typical one.".to_owned());
    }
    if !record.absent.is_empty() {
        let names: Vec<_> = record.absent.iter().map(|absent| absent.name.clone()).collect();
        limits.push(format!("Asked for but not run: {}.", listed(&names)));
    }
    limits
}

fn runs(record: &RaceRecord) -> String {
    let starts = count(record.starts.count);
    let seed = record.noise_seeds.first();
    let seed = seed.map_or_else(String::new, |seed| format!(", with noise seed {seed}"));
    format!(
        "Each 95 % interval is of one run of {starts} races{seed}. It says how far the rate of \
         that run may lie from the rate over all starts of the same kind, one controller and one \
         judge at a time."
    )
}

fn seeds(record: &RaceRecord) -> String {
    match record.noise_seeds.len() {
        0 | 1 => "One noise seed was run: how much the rate changes from seed to seed is not \
                  known."
            .to_owned(),
        seeds => format!(
            "All {} share the same {} starts: the spread between seeds is of the noise alone and \
             says nothing about other starts.",
            counted(seeds, "noise seed", "noise seeds"),
            count(record.starts.count)
        ),
    }
}

/// What the beta of a controller's experiment allows to say.
fn beta(controller: &ControllerRecord) -> Option<String> {
    let tiers = controller.tiers.as_ref().filter(|tiers| tiers.beta_total > 0.0)?;
    let name = &controller.name;
    let (race, total) = (upper(tiers.beta_race), upper(tiers.beta_total));
    Some(if tiers.beta_total < 1.0 {
        format!(
            "{name}: the certificates of all its races hold together with confidence at least \
             1 − {total}, those of a single race with at least 1 − {race}."
        )
    } else {
        format!(
            "{name}: the betas of all its races sum to {total}. At 1 and above the union bound \
             says nothing about all its certificates together; a single race spent at most {race}."
        )
    })
}

/// How many p-values there are, none corrected for the others.
fn comparisons(record: &RaceRecord) -> Option<String> {
    let judged = record.controllers.iter().flat_map(|controller| &controller.judged);
    let comparisons = judged.filter(|judged| judged.against_hybrid.is_some()).count();
    (comparisons > 1)
        .then(|| {
            format!(
                "None of the {comparisons} p-values and intervals of differences is corrected for there \
                 being others."
            )
        })
}
