//! `sweep` from outside: points are what `race` and `certify` come to, however they came about.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::common;
use crate::sweep_run;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::sweep_run::{CONFIG, Folder, command, done, message_of, record, sweep};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use reachcast::config::{Config, Overrides};
use reachcast::race::record::RaceRecord;
use reachcast::race::sweep::record::{CertificatePoint, PointResult, RacePoint, SweepRecord};
use reachcast::scenario::bound::{required_scenarios, simple_scenarios};
use reachcast::scenario::record::{GrowthOutcome, Record};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Keys, Unwatched, certify};

/// Columns that are measured anew.
const TIMED: [&str; 5] = ["step_ms_median", "step_ms_p95", "step_ms_p99", "batch_ms", "seconds"];

/// The rows of `sweep.csv` without what is measured anew, header first.
fn rows(out: &Path) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_path(out.join("sweep.csv"));
    let all: Vec<csv::StringRecord> =
        reader.as_mut().unwrap().records().map(|row| row.unwrap()).collect();
    let timed: Vec<bool> = all[0].iter().map(|name| TIMED.contains(&name)).collect();
    let kept = |row: &csv::StringRecord| {
        let cells = row.iter().zip(&timed).filter(|(_, timed)| !**timed);
        cells.map(|(cell, _)| cell.to_owned()).collect()
    };
    all.iter().map(kept).collect()
}

fn races(record: &SweepRecord) -> Vec<&RacePoint> {
    let mut races = Vec::new();
    for point in &record.points {
        match &point.result {
            PointResult::Race(race) => races.push(race),
            other => panic!("{other:?}"),
        }
    }
    races
}

fn certificates(record: &SweepRecord) -> Vec<&CertificatePoint> {
    let mut certificates = Vec::new();
    for point in &record.points {
        match &point.result {
            PointResult::Certificate(certificate) => certificates.push(certificate),
            other => panic!("{other:?}"),
        }
    }
    certificates
}

/// What `reachcast` prints with these arguments, which has to succeed.
fn printed(arguments: &[&str], out: &Path) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    command.args(arguments).args(["--backend", "cpu", "--json", "--out"]).arg(out);
    let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

/// Names of the stored points.
fn points(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(out.join("points")).into_iter().flatten();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".json")).collect();
    names.sort();
    names
}

#[test]
fn a_point_is_what_race_flies() {
    let folder = Folder::new();
    let grid = ["--controllers", "mppi,hybrid", "--samples", "8,32", "--noise-seeds", "2"];
    let record = sweep(&folder.path("sweep"), &grid);
    assert_eq!((record.total, record.points.len()), (4, 4));
    let axes: Vec<&str> = record.axes.iter().map(|axis| axis.name.as_str()).collect();
    assert_eq!(axes, ["controller", "samples"]);
    for (i, point) in record.points.iter().enumerate() {
        let [controller, samples] = [&point.values[0], &point.values[1]];
        let (name, of) = (["mppi", "hybrid"][i / 2], ["8", "32"][i % 2]);
        assert_eq!((controller.as_str(), samples.as_str()), (name, of));
        let sections: &[&str] = match name {
            "mppi" => &["race.mppi"],
            _ => &["race.hybrid.recovery", "race.hybrid.fast"],
        };
        let set: Vec<String> =
            sections.iter().map(|section| format!("--set={section}.samples={samples}")).collect();
        let mut arguments =
            vec!["race", CONFIG, "--starts", sweep_run::STARTS, "--noise-seeds", "2"];
        arguments.extend(["--set", sweep_run::STEPS, "--controllers", name]);
        arguments.extend(set.iter().map(String::as_str));
        let text = printed(&arguments, &folder.path(&format!("race{i}")));
        let race: RaceRecord = serde_json::from_str(&text).unwrap();
        let swept = races(&record)[i];
        assert_eq!(swept.races, 2 * race.starts.count);
        for (ours, theirs) in swept.judged.iter().zip(&race.controllers[0].judged) {
            assert_eq!(ours.successes, theirs.successes, "{name}, {samples}");
            assert_eq!((ours.rate, ours.interval), (theirs.rate, theirs.interval));
            assert_eq!(ours.failures, theirs.failures);
            assert!(ours.published.is_none());
        }
        let samples: f64 = samples.parse().unwrap();
        let effective = swept.effective_samples.unwrap();
        assert!((1.0..=samples).contains(&effective), "{effective} of {samples}");
        assert!(swept.best_cost.unwrap() > 0.0);
        let latency = &swept.latency;
        let seconds = [latency.median_seconds, latency.p95_seconds, latency.p99_seconds];
        assert!(latency.steps > 0 && seconds[0] > 0.0 && seconds.is_sorted(), "{latency:?}");
    }
}

#[test]
fn axes_change_what_they_are_named_for() {
    let folder = Folder::new();
    let differs = |name: &str, axis: &[&str]| {
        let record = sweep(&folder.path(name), axis);
        let of: Vec<_> =
            races(&record).iter().map(|p| (p.best_cost, p.effective_samples)).collect();
        assert_eq!(of.len(), 2, "{name}");
        assert!(of[0] != of[1], "{name}: {of:?}");
    };
    differs("samples", &["--samples", "8,16"]);
    differs("horizon", &["--horizon", "5,10"]);
    differs("temperature", &["--temperature", "1,1000"]);
    differs("sigma", &["--sigma", "0.2,[0.2,0.4,0.4]"]);
    differs("noise", &["--noise", "independent,colored:3"]);
    differs("spline", &["--noise", "independent,spline:4"]);
    differs("iterations", &["--iterations", "1,2"]);
    differs("vary", &["--vary", "race.mppi.cost.speed=0.5,2"]);
}

#[test]
fn a_controller_without_plans_is_raced_once() {
    let folder = Folder::new();
    let out = folder.path("out");
    let record = sweep(&out, &["--controllers", "policy,mppi", "--samples", "8,16,32"]);
    assert_eq!(record.points.len(), 6);
    assert_eq!(points(&out).len(), 4);
    let all = races(&record);
    assert!(all[0] == all[1] && all[1] == all[2]);
    assert_eq!((all[0].effective_samples, all[0].best_cost), (None, None));
}

#[test]
fn threads_and_repetition_change_nothing() {
    let folder = Folder::new();
    let [one, two] = ["one", "two"].map(|name| folder.path(name));
    let grid = |threads| ["--samples", "8,32", "--horizon", "5,10", "--threads", threads];
    sweep(&one, &grid("1"));
    let first = sweep(&two, &grid("2"));
    assert_eq!(rows(&one), rows(&two));
    // Times and all: what is stored is not computed again.
    assert_eq!(sweep(&two, &grid("1")), first);
}

#[test]
fn a_grid_can_be_extended() {
    let folder = Folder::new();
    let out = folder.path("out");
    let first = sweep(&out, &["--samples", "8,16"]);
    let more = sweep(&out, &["--samples", "16,32,8"]);
    assert_eq!(more.points[0], first.points[1]);
    assert_eq!(more.points[2], first.points[0]);
    assert_eq!(points(&out).len(), 3);
    assert_eq!(rows(&out).len(), 4);
}

#[test]
fn a_killed_sweep_is_taken_up_where_it_stopped() {
    let folder = Folder::new();
    let (whole, out) = (folder.path("whole"), folder.path("killed"));
    let grid = ["--samples", "8,16,32,64", "--horizon", "5,10"];
    sweep(&whole, &grid);
    let mut child = command(&out, &grid).stdout(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while points(&out).len() < 2 && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let stored = points(&out);
    assert!((2..8).contains(&stored.len()), "{stored:?}");
    let bytes = |name: &String| std::fs::read(out.join("points").join(name)).unwrap();
    let before: Vec<Vec<u8>> = stored.iter().map(bytes).collect();
    // A table of the points so far is there, header and all.
    assert!(rows(&out).len() > 1);
    sweep(&out, &grid);
    assert_eq!(rows(&out), rows(&whole));
    assert!(stored.iter().map(bytes).collect::<Vec<_>>() == before);
}

#[test]
fn tables_say_the_same() {
    let folder = Folder::new();
    let out = folder.path("out");
    sweep(&out, &["--samples", "8,16", "--noise", "independent,colored:2.5"]);
    let mut reader = csv::Reader::from_path(out.join("sweep.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let csv: Vec<csv::StringRecord> = reader.records().map(|row| row.unwrap()).collect();
    let file = std::fs::File::open(out.join("sweep.parquet")).unwrap();
    let parquet = SerializedFileReader::new(file).unwrap();
    let rows: Vec<_> =
        parquet.get_row_iter(None).unwrap().map(|row| row.unwrap().into_columns()).collect();
    assert_eq!((csv.len(), rows.len()), (4, 4));
    for (cells, row) in csv.iter().zip(rows) {
        assert_eq!(row.len(), header.len());
        for ((name, cell), (column, field)) in header.iter().zip(cells).zip(row) {
            assert_eq!(name, column);
            let text = match field {
                Field::Str(text) => text,
                Field::Long(count) => count.to_string(),
                Field::Double(number) => number.to_string(),
                Field::Null => String::new(),
                other => panic!("{name}: {other:?}"),
            };
            assert_eq!(text, cell, "{name}");
        }
    }
}

#[test]
fn damaged_points_are_not_counted() {
    let folder = Folder::new();
    let out = folder.path("out");
    let grid = ["--samples", "8,16"];
    let whole = sweep(&out, &grid);
    let names = points(&out);
    let path = out.join("points").join(&names[0]);
    let text = std::fs::read(&path).unwrap();
    let refuse = |bytes: &[u8], words: &str| {
        std::fs::write(&path, bytes).unwrap();
        let message = message_of(&command(&out, &grid).output().unwrap(), 2);
        for word in [names[0].as_str(), words, "remove the file"] {
            assert!(message.contains(word), "no `{word}` in: {message}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
    };
    refuse(&text[..text.len() / 2], "EOF");
    refuse(b"", "EOF");
    refuse(&std::fs::read(out.join("points").join(&names[1])).unwrap(), "of another point");
    std::fs::remove_file(&path).unwrap();
    let again = sweep(&out, &grid);
    let rates = |record| races(record).iter().map(|p| p.judged.clone()).collect::<Vec<_>>();
    assert_eq!(rates(&again), rates(&whole));
}

/// The certificate of `config` under `set`, on the samples of the seed: those of a sweep's points.
fn certificate(config: &str, set: Vec<String>) -> Record {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(config);
    let config = Config::load(&path, &Overrides { set, ..Overrides::default() }).unwrap();
    let policy = config.policy_source(path.parent().unwrap()).unwrap();
    let plant = config.plant(&policy).unwrap();
    let settings = config.settings(&plant.model.states).unwrap();
    let settings = Settings { keys: Keys::Seed, ..settings };
    let backend = common::cpu(2);
    let program = backend.prepare(&plant).unwrap();
    certify(&program, &settings, serde_json::Value::Null, &Unwatched).unwrap()
}

#[test]
fn certificates_are_what_certify_makes() {
    let folder = Folder::new();
    let out = folder.path("out");
    let config = "configs/double_integrator.toml";
    let draws = ["--set", "global.draws=2000"];
    let mut grid = vec!["--of", "certificate", "--epsilon", "0.05,0.1", "--count", "simple,exact"];
    grid.extend(draws);
    let record: SweepRecord = done(config, &out, &grid);
    assert!(record.starts.is_none() && record.judge.is_none());
    let all = certificates(&record);
    assert_eq!(all.len(), 4);
    for (i, (epsilon, exact)) in
        [(0.05, false), (0.05, true), (0.1, false), (0.1, true)].into_iter().enumerate()
    {
        let count = |beta| match exact {
            true => required_scenarios(epsilon, beta, 1).unwrap(),
            false => simple_scenarios(epsilon, beta, 1).unwrap(),
        };
        // Upward, all of beta is there for each round.
        let (pairs, growth) = (count(1e-3), count(1e-3));
        let point = all[i];
        assert_eq!((point.deviation_scenarios, point.growth_scenarios), (pairs, growth));
        let keys = [
            format!("deviation.epsilon={epsilon}"),
            format!("growth.epsilon={epsilon}"),
            format!("deviation.scenarios={pairs}"),
            format!("growth.scenarios={growth}"),
            draws[1].to_owned(),
        ];
        let one = certificate(config, keys.to_vec());
        assert_eq!(point.share_interval, one.global.share_interval);
        assert_eq!(point.volume_interval, one.global.volume_interval);
        assert_eq!(point.conditional_risk, one.global.claim.certified_risk);
        assert_eq!(point.deviation_risk, one.deviation.claim.certified_risk);
        let most = one.deviation.bound.iter().copied().fold(0.0, f64::max);
        assert_eq!(point.deviation_bound, most);
        assert_eq!((point.growth, point.radius), (one.growth.outcome, one.growth.radius));
        assert_eq!((point.holds, point.beta_total), (one.holds, one.beta_total));
    }
    assert!(all.iter().any(|point| point.growth == GrowthOutcome::Verified));
}

/// An axis that nothing reads is said to be one, beside another that counts.
#[test]
fn an_axis_that_changes_nothing_is_named() {
    let folder = Folder::new();
    let grid = ["--of", "certificate", "--radius", "0.02,0.03", "--vary", "race.steps=5,6"];
    let short = ["--set", "global.draws=500"];
    let of = |out: &str, grid: &[&str]| {
        done("configs/smoke.toml", &folder.path(out), &[grid, &short[..]].concat()).notes
    };
    let notes = of("two", &grid);
    assert!(
        matches!(&notes[..], [note] if note.contains("changes with `race.steps`")),
        "{notes:?}"
    );
    assert_eq!(of("one", &grid[..4]), Vec::<String>::new());
}

#[test]
fn bounds_of_certificates_are_told_apart() {
    let folder = Folder::new();
    let config = "configs/double_integrator.toml";
    let grid = ["--of", "certificate", "--bound", "fixed-shape,variables,bonferroni,exact"];
    let short = ["--set", "global.draws=1000", "--horizon", "10,20", "--radius", "0.02"];
    let record: SweepRecord = done(config, &folder.path("out"), &[&grid[..], &short[..]].concat());
    let all = certificates(&record);
    assert_eq!(all.len(), 8);
    let of = |bound: &str, horizon: &str| {
        let fits = |values: &[String]| {
            values.iter().any(|value| value == bound) && values.iter().any(|value| value == horizon)
        };
        let at = record.points.iter().position(|point| fits(&point.values)).unwrap();
        all[at]
    };
    for horizon in ["10", "20"] {
        let exact = of("exact", horizon).deviation_bound;
        let shape = of("fixed-shape", horizon);
        let variables = of("variables", horizon);
        assert!(variables.deviation_bound <= exact, "largest distances lie below the supremum");
        let steps = horizon.parse().unwrap();
        let need = simple_scenarios(0.1, 1e-3, steps).unwrap();
        assert_eq!(variables.deviation_scenarios, need);
        assert_eq!(shape.deviation_scenarios, 159);
        let need = simple_scenarios(0.1 / f64::from(steps), 1e-3 / f64::from(steps), 1).unwrap();
        assert_eq!(of("bonferroni", horizon).deviation_scenarios, need);
    }
}

#[test]
fn an_adapter_sweeps_too() {
    if common::adapter().is_none() {
        return;
    }
    let folder = Folder::new();
    let run = |backend: &str| -> SweepRecord {
        let out: PathBuf = folder.path(backend);
        let grid = ["--samples", "8,64", "--horizon", "5,10"];
        let mut command = command(&out, &grid);
        command.args(["--backend", backend]);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", message_of(&output, 0));
        record(&out)
    };
    let (cpu, gpu) = (run("cpu"), run("gpu"));
    assert_eq!(gpu.provenance.backend, "gpu");
    for (ours, theirs) in races(&cpu).iter().zip(races(&gpu)) {
        let wins = |point: &RacePoint| {
            point.judged.iter().map(|judged| judged.successes.clone()).collect::<Vec<_>>()
        };
        assert_eq!(wins(ours), wins(theirs));
        let (one, other) = (ours.best_cost.unwrap(), theirs.best_cost.unwrap());
        assert!((one - other).abs() < 1e-2 * one, "{one} and {other}");
    }
}
