//! The tables of the race page: every number of the record but the moments of the picture.

use super::provenance::provenance;
use super::verdicts::{self, CLASSES, Ceiling};
use super::words::{self, points};
use crate::race::judge::Judge;
use crate::race::record::{
    BoundsRecord, ControllerRecord, FilterRecord, JudgedRecord, MetricsRecord, RaceRecord,
    TierRecord,
};
use crate::report::table::{pairs, table};
use crate::report::text::{count, minus, number, or_dash, percent, percents, upper};
use crate::scenario::record::ConstantRecord;

/// A table of more than three columns; nothing without a row.
fn rows(title: &str, head: &[&str], body: Vec<Vec<String>>) -> String {
    if body.is_empty() {
        return String::new();
    }
    let head = head.iter().map(|&name| name.to_owned()).collect();
    table(title, &std::iter::once(head).chain(body).collect::<Vec<_>>())
}

/// The tables that need the width of the page.
pub(super) fn wide(record: &RaceRecord) -> String {
    let judges = words::judges(record);
    let success = judges.iter().map(|&judge| success(record, judge) + &compared(record, judge));
    let failures = judges.iter().map(|&judge| failures(record, judge));
    let metrics = judges.iter().map(|&judge| metrics(record, judge));
    let all: String = success.chain(failures).chain(metrics).collect();
    all + &tiers(record) + &filters(record)
}

/// The tables of two columns.
pub(super) fn narrow(record: &RaceRecord) -> String {
    starts(record) + &absent(record) + &bounds(record) + &made_by(record)
}

fn success(record: &RaceRecord, judge: Judge) -> String {
    let head = [
        "controller",
        "won per seed",
        "mean rate",
        "95 % interval, first seed",
        "spread of seeds, points",
        "published",
        "published interval",
    ];
    let body = words::verdicts(record, judge)
        .map(|(controller, judged)| success_row(controller, judged))
        .collect();
    rows(&format!("Races won under the {} judge", judge.name()), &head, body)
}

/// The paired comparisons with the hybrid on the same starts.
fn compared(record: &RaceRecord, judge: Judge) -> String {
    let head = [
        "controller",
        "difference of the mean rates, points",
        "95 % interval of it",
        "starts won by it alone, first seed",
        "starts won by the hybrid alone, first seed",
        "McNemar p-value",
    ];
    let row = |(controller, judged): (&ControllerRecord, &JudgedRecord)| {
        let paired = judged.against_hybrid.as_ref()?;
        Some(vec![
            controller.name.clone(),
            points(paired.difference),
            words::point_interval(paired.interval),
            count(paired.only_this),
            count(paired.only_other),
            minus(&upper(paired.p_value)),
        ])
    };
    let body = words::verdicts(record, judge).filter_map(row).collect();
    let title = format!("Compared with the hybrid under the {} judge", judge.name());
    rows(&title, &head, body)
}

fn success_row(controller: &ControllerRecord, judged: &JudgedRecord) -> Vec<String> {
    let seeds: Vec<_> = judged.successes.iter().map(|&won| count(won)).collect();
    let published = judged.published.as_ref();
    vec![
        controller.name.clone(),
        seeds.join(" · "),
        percent(judged.rate),
        percents(judged.interval),
        or_dash(judged.spread.map(|spread| number(100.0 * spread))),
        or_dash(published.map(|published| percent(published.rate))),
        or_dash(published.map(|published| percents(published.interval))),
    ]
}

fn failures(record: &RaceRecord, judge: Judge) -> String {
    let names = CLASSES.map(verdicts::class);
    let head: Vec<&str> = ["controller"].into_iter().chain(names).chain(["all"]).collect();
    let body = words::verdicts(record, judge).map(|(controller, judged)| {
        let counts = CLASSES.map(|class| verdicts::failures(judged, class));
        let name = controller.name.clone();
        let all = counts.iter().sum();
        std::iter::once(name).chain(counts.into_iter().chain([all]).map(count)).collect()
    });
    let title = format!(
        "Races lost under the {} judge, of {} over all seeds",
        judge.name(),
        count(words::races(record))
    );
    rows(&title, &head, body.collect())
}

fn metrics(record: &RaceRecord, judge: Judge) -> String {
    let head = [
        "controller",
        "races",
        "time to the gate, s",
        "path, m",
        "mean jerk, m/s³",
        "mean acceleration, m/s²",
        "mean of smallest distances, m",
        "smallest distance, m",
    ];
    let own = |controller: &ControllerRecord| -> Option<Vec<String>> {
        let metrics = controller.metrics.as_ref().filter(|metrics| metrics.judge == judge)?;
        Some(std::iter::once(controller.name.clone()).chain(metrics_row(metrics)).collect())
    };
    let body = record.controllers.iter().filter_map(own).collect();
    let judge = judge.name();
    rows(&format!("Means over successes under the {judge} judge"), &head, body)
}

fn metrics_row(metrics: &MetricsRecord) -> [String; 7] {
    [
        count(metrics.races),
        number(metrics.time_seconds),
        number(metrics.path_m),
        number(metrics.jerk),
        number(metrics.acceleration),
        number(metrics.separation_m),
        number(metrics.least_separation_m),
    ]
}

fn tiers(record: &RaceRecord) -> String {
    let with: Vec<(&str, &TierRecord)> = record
        .controllers
        .iter()
        .filter_map(|controller| Some((controller.name.as_str(), controller.tiers.as_ref()?)))
        .collect();
    if with.is_empty() {
        return String::new();
    }
    let row = |name: &str, value: &dyn Fn(&TierRecord) -> String| -> Vec<String> {
        let values = with.iter().map(|(_, tiers)| value(tiers));
        std::iter::once(name.to_owned()).chain(values).collect()
    };
    let mut head = vec!["quantity"];
    head.extend(with.iter().map(|(name, _)| *name));
    let body = vec![
        row("control steps in tier 0", &|tiers| percent(tiers.shares[0])),
        row("control steps in tier 1", &|tiers| percent(tiers.shares[1])),
        row("control steps in tier 2", &|tiers| percent(tiers.shares[2])),
        row("control steps in tier 3", &|tiers| percent(tiers.shares[3])),
        row("calls of local growth", &|tiers| count(tiers.growth_calls)),
        row("calls that ended with a verified ball", &|tiers| count(tiers.growth_verified)),
        row("rounds of growth", &|tiers| count(tiers.growth_rounds)),
        row("calls that the ledger refused", &|tiers| count(tiers.growth_refused)),
        row("f64 re-runs of growth", &|tiers| count(tiers.f64_reruns)),
        row("beta of the deviation bound", &|tiers| upper(tiers.beta_deviation)),
        row("beta of one call of growth", &|tiers| upper(tiers.beta_call)),
        row("largest beta of a race", &|tiers| upper(tiers.beta_race)),
        row("beta of all races", &|tiers| upper(tiers.beta_total)),
    ];
    rows("Tiers, growth and beta", &head, body)
}

fn filters(record: &RaceRecord) -> String {
    let head = ["controller", "steps", "changed", "relaxed", "inaccurate", "failed"];
    let row = |controller: &ControllerRecord| {
        let filter: &FilterRecord = controller.filter.as_ref()?;
        let counts =
            [filter.calls, filter.active, filter.relaxed, filter.inaccurate, filter.failed];
        Some(std::iter::once(controller.name.clone()).chain(counts.map(count)).collect())
    };
    let body = record.controllers.iter().filter_map(row).collect();
    rows("Control barrier filter, control steps", &head, body)
}

fn starts(record: &RaceRecord) -> String {
    let starts = &record.starts;
    let seeds: Vec<_> = record.noise_seeds.iter().map(u64::to_string).collect();
    let seconds = f64::from(record.steps) * record.step_seconds;
    let mut values = vec![
        ("starts", count(starts.count)),
        ("source", starts.source.clone()),
        ("starts SHA-256", starts.sha256.clone()),
        ("noise seeds", seeds.join(", ")),
        ("longest race", format!("{} steps, {} s", record.steps, number(seconds))),
        ("control step", format!("{} s", number(record.step_seconds))),
    ];
    for judge in words::judges(record) {
        if let Some(Ceiling { safe, share }) = words::ceiling(record, judge) {
            let name = match judge {
                Judge::Study => "safe at t = 0, study judge",
                Judge::Paper => "safe at t = 0, paper judge",
                Judge::Rigorous => "safe at t = 0, rigorous judge",
            };
            values.push((name, format!("{}, {}", count(safe), percent(share))));
        }
    }
    pairs("Starts and noise", &values)
}

fn absent(record: &RaceRecord) -> String {
    let absent = record.absent.iter();
    let body = absent.map(|absent| vec![absent.name.clone(), absent.reason.clone()]).collect();
    rows("Controllers that did not run", &["controller", "reason"], body)
}

/// What V_check was computed with, and the deviation bound's own statement.
fn bounds(record: &RaceRecord) -> String {
    let Some(BoundsRecord { constants, deviation, band, sequence, .. }) = &record.bounds else {
        return String::new();
    };
    let constant =
        |constant: &ConstantRecord| format!("{} ({})", upper(constant.used), constant.source);
    let claim = &deviation.claim;
    let set = sequence.as_ref().and_then(|sequence| sequence.levels.get(sequence.chosen));
    let set = set.map(|set| {
        let risk = or_dash(set.risk.map(upper));
        format!("margin drops at level {}, conditional risk at most {risk}", upper(set.level))
    });
    pairs(
        "What V_check was computed with",
        &[
            ("certified set", set.unwrap_or_else(|| "constants times the bound".to_owned())),
            ("deviation bound", claim.statement.clone()),
            ("measure", claim.measure.clone()),
            ("pairs", format!("{}, none allowed to exceed the bound", count(claim.scenarios))),
            ("Lipschitz constant of the target margin", constant(&constants.target)),
            ("Lipschitz constant of the constraint margin", constant(&constants.constraint)),
            ("run again in f64 within", upper(*band)),
        ],
    )
}

fn made_by(record: &RaceRecord) -> String {
    let networks = [
        ("value network SHA-256", record.value_sha256.as_ref()),
        ("disturbance network SHA-256", record.disturbance_sha256.as_ref()),
        ("PPO policy SHA-256", record.ppo_sha256.as_ref()),
    ];
    provenance(record.schema, &record.provenance, &networks)
}
