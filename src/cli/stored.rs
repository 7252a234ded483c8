//! The commands `query` and `check`: a stored certificate used and verified again.

use std::fmt::Write;
use std::hash::BuildHasher;
use std::path::{Path, PathBuf};

use super::options::Global;
use serde::Serialize;

use super::inputs::networks;
use super::progress::Progress;
use super::{Outcome, devices, document, effort, report};
use crate::certificate::{CERTIFICATE, POLICY, derived_files};
use crate::config::{Config, PolicySource, Registry};
use crate::error::{Error, Result};
use crate::files::{Existing, Inputs, RECORD_BYTES, Staged, StateReader, read, read_text};
use crate::rollout::States;
use crate::rounding::upper;
use crate::scenario::drops_record::SequenceRecord;
use crate::scenario::record::{Record, SCHEMA};
use crate::scenario::settings::Settings;
use crate::scenario::{self, Beside, CheckReport, Figure, Finding, QueryRow};

/// Name of the file with a line per state.
const ANSWERS: &str = "query.csv";

/// What the lines of `check` mean.
const FRESH: &str = "\
stored: what the certificate says; found: computed again from its seed, or on fresh pairs and starts, which
are drawn anew and may refute a claim, not prove it";

/// A stored certificate with the configuration and the policy that it was made with.
pub(super) struct Stored {
    pub(super) record: Record,
    pub(super) config: Config,
    pub(super) policy: PolicySource,
}

impl Stored {
    /// Reads what `certify` wrote to `folder`.
    pub(super) fn read(folder: &Path, registry: &Registry) -> Result<Self> {
        let path = folder.join(CERTIFICATE);
        let text = read_text(&path, RECORD_BYTES).map_err(|e| Error::file(&path, e))?;
        let record = Record::read(&text).map_err(|error| at(&path, error))?;
        let config =
            Config::from_json_of(&record.provenance.config, registry)?.with_copies(folder)?;
        let policy = match &config.policy.file {
            Some(_) => PolicySource::read(folder.join(POLICY))?,
            None => config.policy_source(folder)?,
        };
        Ok(Self { record, config, policy })
    }
}

/// The refusal with the file that it is about.
fn at(path: &Path, error: Error) -> Error {
    match error {
        Error::Refused(problem) => Error::Refused(format!("{}: {problem}", path.display())),
        other => other,
    }
}

/// Tells tier and margins of each state of the file.
pub(super) fn query(global: &Global, folder: &Path, states: &Path) -> Result<Outcome> {
    let stored = Stored::read(folder, &global.registry)?;
    if let Some(out) = &global.out {
        let read = [states.to_owned(), folder.join(CERTIFICATE), folder.join(POLICY)];
        Inputs::new(read.into_iter().chain(networks(&stored.config)))
            .spare_file(&out.join(ANSWERS))?;
    }
    // Before the work: a folder that cannot be written to would waste it.
    let staged = global.out.as_deref().map(Staged::new).transpose()?;
    let rows = ask(global, &stored, states)?;
    match staged {
        None => report(global, &document(&answers(&stored.record, &rows)), || csv(&rows))?,
        Some(staged) => {
            let path = write(staged, &rows, global.existing)?;
            let words = || counts(&stored.record, &rows, &path);
            report(global, &document(&answers(&stored.record, &rows)), words)?;
        }
    }
    Ok(Outcome::Done)
}

/// Tier and margins of the states of a file.
fn ask(global: &Global, stored: &Stored, states: &Path) -> Result<Vec<QueryRow>> {
    let Stored { record, config, policy } = stored;
    let plant = config.plant(policy)?;
    let names = plant.model.states.iter().map(|axis| axis.name.clone()).collect();
    let states = StateReader::open(states, names)?.rest()?;
    let settings = config.settings(&plant.model.states)?;
    let backend = devices::open(global)?;
    let program = backend.prepare(&plant)?;
    let rows = scenario::query(&program, record, &settings, states.view())?;
    note_outside(&settings, states.view());
    devices::note_events(global, &backend);
    Ok(rows)
}

/// Says how many of `states` lie outside the box, where no claim speaks of them.
fn note_outside(settings: &Settings, states: States<'_>) {
    use std::io::Write as _;
    let outside = states.iter().filter(|x| !settings.in_box(x)).count();
    if outside > 0 {
        // Whatever becomes of standard error, the answers stand.
        let _ = writeln!(
            std::io::stderr(),
            "note: {outside} of {} states lie outside the box that was drawn from: no claim speaks of them, \
             whatever their tier",
            states.len()
        );
    }
}

/// Writes the rows to [`ANSWERS`].
fn write(mut staged: Staged, rows: &[QueryRow], existing: Existing) -> Result<PathBuf> {
    staged.add(ANSWERS, csv(rows).as_bytes())?;
    Ok(staged.publish_sparing(existing)?.remove(0))
}

/// A row with the number of its state in the file, from 0.
#[derive(Serialize)]
struct Numbered<'a> {
    index: usize,
    #[serde(flatten)]
    row: &'a QueryRow,
}

/// What `query --json` prints.
#[derive(Serialize)]
struct Answers<'a> {
    /// What the score of a certified state is above.
    #[serde(with = "crate::files::number", skip_serializing_if = "Option::is_none")]
    level: Option<f64>,
    /// What the measure of a state of the calibrated set is above.
    #[serde(with = "crate::files::number", skip_serializing_if = "Option::is_none")]
    alpha: Option<f64>,
    rows: Vec<Numbered<'a>>,
}

fn answers<'a>(record: &Record, rows: &'a [QueryRow]) -> Answers<'a> {
    let numbered = rows.iter().enumerate().map(|(index, row)| Numbered { index, row });
    Answers { level: level(record), alpha: alpha(record), rows: numbered.collect() }
}

/// The level of the certified set, where a sequence chose it.
fn level(record: &Record) -> Option<f64> {
    record.sequence.as_ref().and_then(SequenceRecord::level)
}

/// The level of the calibrated set.
fn alpha(record: &Record) -> Option<f64> {
    record.calibration.as_ref().map(|calibration| calibration.level)
}

/// A line per state.
fn csv(rows: &[QueryRow]) -> String {
    let line = |(index, row): (usize, &QueryRow)| {
        let QueryRow { tier, check_margin, target_margin, beside } = row;
        let more: String = columns(beside).map(|(_, cell)| format!(",{cell}")).collect();
        format!("{index},{},{check_margin},{target_margin}{more}\n", tier.number())
    };
    let lines: String = rows.iter().enumerate().map(line).collect();
    let more = rows.iter().take(1).flat_map(|row| columns(&row.beside));
    let more: String = more.map(|(name, _)| format!(",{name}")).collect();
    format!("index,tier,check_margin,target_margin{more}\n{lines}")
}

/// The columns of what the certificate has beside the tier.
fn columns(beside: &Beside) -> impl Iterator<Item = (&'static str, String)> + use<> {
    let Beside { score, measure, calibrated, radius } = *beside;
    let number = |name, value: Option<f64>| value.map(|value| (name, value.to_string()));
    [
        number("score", score),
        number("measure", measure),
        calibrated.map(|inside| ("calibrated", inside.to_string())),
        number("radius", radius),
    ]
    .into_iter()
    .flatten()
}

/// How many states are of each tier, and in the other sets.
fn counts(record: &Record, rows: &[QueryRow], path: &Path) -> String {
    let verified = format!("in the verified {}", record.growth.shape().name());
    let names = ["in the target", "certified", &verified, "none of these"];
    let line = |(tier, name): (usize, &str)| {
        let count = rows.iter().filter(|row| usize::from(row.tier.number()) == tier).count();
        format!("tier {tier} ({name}): {count}\n")
    };
    let lines: String = names.into_iter().enumerate().map(line).collect();
    let words =
        "V_check: the measure of the task with its margins tightened, certified where positive";
    let others = others(record, rows);
    format!("{lines}{words}\n{others}rows: {}\n", path.display())
}

/// How many states the other parts of the certificate hold.
fn others(record: &Record, rows: &[QueryRow]) -> String {
    let mut lines = String::new();
    // A String takes whatever is written to it, here and below.
    if let Some(level) = level(record) {
        let _ = writeln!(lines, "score: the largest lambda; certified above {}", upper(level));
    }
    if let Some(alpha) = alpha(record) {
        let inside = rows.iter().filter(|row| row.beside.calibrated == Some(true)).count();
        let _ = writeln!(lines, "calibrated (measure above {}): {inside}", upper(alpha));
    }
    if let Some(found) = &record.deterministic {
        let certified = |row: &&QueryRow| row.beside.radius.is_some_and(|r| r >= found.radius);
        let inside = rows.iter().filter(certified).count();
        let radius = found.radius;
        let _ = writeln!(lines, "certified without samples (radius at least {radius}): {inside}");
    }
    lines
}

/// Verifies the certificate in the folder again.
pub(super) fn check(
    global: &Global,
    folder: &Path,
    fresh_seed: Option<u64>,
    effort: f64,
) -> Result<Outcome> {
    let stored = Stored::read(folder, &global.registry)?;
    let mut found = verify(global, &stored, fresh_seed.unwrap_or_else(another_seed), effort)?;
    // Of a record that does not hold, a page may not even be made.
    if found.holds {
        found.add(files(folder, &stored.record)?);
    }
    report(global, &document(&found), || findings(&found))?;
    Ok(if found.holds { Outcome::Done } else { Outcome::NotObtained })
}

/// Whether the files beside the certificate say what it says; one that is gone says nothing, and
/// another version of the program may have laid them out differently.
fn files(folder: &Path, record: &Record) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    if record.provenance.version != env!("CARGO_PKG_VERSION") || record.schema != SCHEMA {
        return Ok(findings);
    }
    for (name, bytes) in derived_files(record) {
        let path = folder.join(name);
        let found = match read(&path, RECORD_BYTES) {
            Ok(found) => found,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
            Err(error) => return Err(Error::file(&path, error)),
        };
        let holds = found == bytes;
        findings.push(Finding {
            name: name.to_owned(),
            stored: Figure::Words(format!("as {CERTIFICATE} gives it")),
            found: Figure::Words(if holds { "the same" } else { "other content" }.to_owned()),
            holds,
        });
    }
    Ok(findings)
}

/// A seed that no earlier call had: the clock and the number of the process, mixed by a hasher whose
/// keys are random. It is kept below 2^53, which every reader of JSON has exactly.
fn another_seed() -> u64 {
    let clock = std::time::SystemTime::now();
    let hasher = std::collections::hash_map::RandomState::new();
    hasher.hash_one((clock, std::process::id())) >> 11
}

/// Computes a certificate again and tries its claims on fresh scenarios.
fn verify(global: &Global, stored: &Stored, fresh_seed: u64, effort: f64) -> Result<CheckReport> {
    let Stored { record, config, policy } = stored;
    let plant = config.plant(policy)?;
    let settings = config.settings(&plant.model.states)?;
    effort::say(global, &plant, &settings, effort)?;
    let backend = devices::open(global)?;
    let progress = Progress::new(global);
    let program = backend.prepare(&plant)?;
    let found = scenario::check(&program, record, &settings, fresh_seed, &progress)?;
    devices::note_events(global, &backend);
    Ok(found)
}

/// The findings, a line each, and the verdict.
fn findings(found: &CheckReport) -> String {
    let line = |finding: &Finding| {
        let mark = if finding.holds { "ok   " } else { "FAILS" };
        format!("{mark} {}: stored {}, found {}\n", finding.name, finding.stored, finding.found)
    };
    let lines: String = found.findings.iter().map(line).collect();
    let stored_false = |finding: &Finding| finding.stored == Figure::Flag(false);
    let verdict = match found.holds {
        true if found.findings.iter().any(stored_false) => {
            "the certificate holds as it is stored: NOT all of its claims were obtained"
        }
        true => "the certificate holds",
        false => "the certificate no longer holds",
    };
    let seed = found.fresh_seed;
    format!("{lines}{FRESH}\nfresh samples: --fresh-seed {seed} draws them again\n{verdict}\n")
}
