//! The commands `query` and `check`: a stored certificate used and verified again.

use std::path::{Path, PathBuf};

use super::options::Global;
use serde::Serialize;

use super::certify::{CERTIFICATE, POLICY, derived_files};
use super::inputs::networks;
use super::progress::Progress;
use super::{Outcome, devices, document, report};
use crate::config::{Config, PolicySource};
use crate::error::{Error, Result};
use crate::files::{Existing, Inputs, RECORD_BYTES, Staged, StateReader, read, read_text};
use crate::scenario::record::Record;
use crate::scenario::{self, CheckReport, Figure, Finding, QueryRow};

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
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(CERTIFICATE);
        let text = read_text(&path, RECORD_BYTES).map_err(|e| Error::file(&path, e))?;
        let record = Record::read(&text).map_err(|error| at(&path, error))?;
        let config = Config::from_json(&record.provenance.config)?.with_copies(folder)?;
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
    let stored = Stored::read(folder)?;
    if let Some(out) = &global.out {
        let read = [states.to_owned(), folder.join(CERTIFICATE), folder.join(POLICY)];
        Inputs::new(read.into_iter().chain(networks(&stored.config)))
            .spare_file(&out.join(ANSWERS))?;
    }
    // Before the work: a folder that cannot be written to would waste it.
    let staged = global.out.as_deref().map(Staged::new).transpose()?;
    let rows = ask(global, &stored, states)?;
    match staged {
        None => report(global, &document(&answers(&rows)), || csv(&rows))?,
        Some(staged) => {
            let path = write(staged, &rows, global.existing)?;
            report(global, &document(&answers(&rows)), || counts(&rows, &path))?;
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
    devices::note_events(global, &backend);
    Ok(rows)
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
    rows: Vec<Numbered<'a>>,
}

fn answers(rows: &[QueryRow]) -> Answers<'_> {
    let numbered = rows.iter().enumerate().map(|(index, row)| Numbered { index, row });
    Answers { rows: numbered.collect() }
}

/// A line per state.
fn csv(rows: &[QueryRow]) -> String {
    let line = |(index, row): (usize, &QueryRow)| {
        let QueryRow { tier, check_margin, target_margin } = row;
        let tier = tier.number();
        format!("{index},{tier},{check_margin},{target_margin}\n")
    };
    let lines: String = rows.iter().enumerate().map(line).collect();
    format!("index,tier,check_margin,target_margin\n{lines}")
}

/// How many states are of each tier.
fn counts(rows: &[QueryRow], path: &Path) -> String {
    let names = ["in the target", "certified", "in the verified ball", "none of these"];
    let line = |(tier, name): (usize, &str)| {
        let count = rows.iter().filter(|row| usize::from(row.tier.number()) == tier).count();
        format!("tier {tier} ({name}): {count}\n")
    };
    let lines: String = names.into_iter().enumerate().map(line).collect();
    let words =
        "V_check: the reach-avoid measure with its margins tightened, certified where positive";
    format!("{lines}{words}\nrows: {}\n", path.display())
}

/// Verifies the certificate in the folder again.
pub(super) fn check(global: &Global, folder: &Path) -> Result<Outcome> {
    let stored = Stored::read(folder)?;
    let mut found = verify(global, &stored)?;
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
    if record.provenance.version != env!("CARGO_PKG_VERSION") {
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

/// Computes a certificate again and tries its claims on fresh scenarios.
fn verify(global: &Global, stored: &Stored) -> Result<CheckReport> {
    let Stored { record, config, policy } = stored;
    let plant = config.plant(policy)?;
    let settings = config.settings(&plant.model.states)?;
    let backend = devices::open(global)?;
    let progress = Progress::new(global);
    let program = backend.prepare(&plant)?;
    let found = scenario::check(&program, record, &settings, &progress)?;
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
    let verdict = match found.holds {
        true => "the certificate holds",
        false => "the certificate no longer holds",
    };
    format!("{lines}{FRESH}\n{verdict}\n")
}
