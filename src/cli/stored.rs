//! The commands `query` and `check`: a stored certificate used and verified again.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::args::Global;
use super::certify::{CERTIFICATE, POLICY};
use super::progress::Progress;
use super::{Outcome, devices, report};
use crate::config::{Config, Job, PolicySource};
use crate::error::{Error, Result};
use crate::files::{Staged, StateReader};
use crate::policy::Policy;
use crate::rollout::Plant;
use crate::scenario::record::{Record, SCHEMA};
use crate::scenario::{self, CheckReport, QueryRow};
use crate::system::System;

/// A stored certificate with the configuration and the policy that it was made with.
struct Stored {
    record: Record,
    config: Config,
    policy: PolicySource,
}

/// The part of a certificate that says how to read the rest.
#[derive(Deserialize)]
struct Schema {
    schema: u32,
}

impl Stored {
    /// Reads what `certify` wrote to `folder`.
    fn read(global: &Global, folder: &Path) -> Result<Self> {
        if global.profile.is_some() || global.seed.is_some() || !global.set.is_empty() {
            let problem = "a stored certificate has its own; leave these flags out";
            return Err(Error::invalid("--profile, --seed and --set", problem));
        }
        let path = folder.join(CERTIFICATE);
        let text = std::fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
        let Schema { schema } = serde_json::from_str(&text)
            .map_err(|e| Error::file(&path, format!("not a certificate ({e})")))?;
        if schema != SCHEMA {
            let problem = format!("schema is {schema}, this program reads {SCHEMA}");
            return Err(Error::Refused(problem));
        }
        let record: Record = serde_json::from_str(&text)
            .map_err(|e| Error::file(&path, format!("damaged certificate ({e})")))?;
        let config = Config::from_json(&record.provenance.config)?;
        let policy = match &config.policy.file {
            Some(_) => PolicySource::read(folder.join(POLICY))?,
            None => config.policy_source(folder)?,
        };
        Ok(Self { record, config, policy })
    }
}

/// Tells tier and margins of each state of the file.
pub(super) fn query(global: &Global, folder: &Path, states: &Path) -> Result<Outcome> {
    let stored = Stored::read(global, folder)?;
    let job = Ask { global, record: &stored.record, states };
    let rows = stored.config.with_plant(&stored.policy, job)?;
    match &global.out {
        None => report(global, &rows, || csv(&rows))?,
        Some(out) => {
            let path = write(out, &rows)?;
            report(global, &rows, || counts(&rows, &path))?;
        }
    }
    Ok(Outcome::Done)
}

/// `query` for one plant.
struct Ask<'a> {
    global: &'a Global,
    record: &'a Record,
    states: &'a Path,
}

impl Job for Ask<'_> {
    type Output = Vec<QueryRow>;

    fn run<S, P, const NX: usize, const NU: usize>(
        self,
        plant: Plant<'_, S, P>,
    ) -> Result<Vec<QueryRow>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let names = plant.system.states().map(|axis| axis.name);
        let states = StateReader::<NX>::open(self.states, names)?.rest()?;
        let backend = devices::open(self.global)?;
        let rows = scenario::query(&backend, plant, self.record, &states)?;
        devices::note_events(self.global, &backend);
        Ok(rows)
    }
}

/// Writes the rows to `query.csv` in the folder `out`.
fn write(out: &Path, rows: &[QueryRow]) -> Result<PathBuf> {
    let mut staged = Staged::new(out)?;
    staged.add("query.csv", csv(rows).as_bytes())?;
    Ok(staged.publish()?.remove(0))
}

/// A line per state.
fn csv(rows: &[QueryRow]) -> String {
    let line = |row: &QueryRow| {
        let QueryRow { tier, check_margin, target_margin } = row;
        format!("{tier},{check_margin},{target_margin}\n")
    };
    let lines: String = rows.iter().map(line).collect();
    format!("tier,check_margin,target_margin\n{lines}")
}

/// How many states are of each tier.
fn counts(rows: &[QueryRow], path: &Path) -> String {
    let names = ["in the target", "certified", "in the verified ball", "none of these"];
    let line = |(tier, name): (usize, &str)| {
        let count = rows.iter().filter(|row| usize::from(row.tier) == tier).count();
        format!("tier {tier} ({name}): {count}\n")
    };
    let lines: String = names.into_iter().enumerate().map(line).collect();
    format!("{lines}rows: {}\n", path.display())
}

/// Verifies the certificate in the folder again.
pub(super) fn check(global: &Global, folder: &Path) -> Result<Outcome> {
    let stored = Stored::read(global, folder)?;
    let job = Verify { global, stored: &stored };
    let found = stored.config.with_plant(&stored.policy, job)?;
    report(global, &found, || findings(&found))?;
    Ok(if found.holds { Outcome::Done } else { Outcome::NotObtained })
}

/// `check` for one plant.
struct Verify<'a> {
    global: &'a Global,
    stored: &'a Stored,
}

impl Job for Verify<'_> {
    type Output = CheckReport;

    fn run<S, P, const NX: usize, const NU: usize>(
        self,
        plant: Plant<'_, S, P>,
    ) -> Result<CheckReport>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let Stored { record, config, .. } = self.stored;
        let settings = config.settings(&plant.system.states())?;
        let backend = devices::open(self.global)?;
        let progress = Progress::new(self.global);
        let found = scenario::check(&backend, plant, record, &settings, &progress)?;
        devices::note_events(self.global, &backend);
        Ok(found)
    }
}

/// The findings, a line each, and the verdict.
fn findings(found: &CheckReport) -> String {
    let line = |finding: &scenario::Finding| {
        let mark = if finding.holds { "ok   " } else { "FAILS" };
        format!("{mark} {}: stored {}, found {}\n", finding.name, finding.stored, finding.found)
    };
    let lines: String = found.findings.iter().map(line).collect();
    let verdict = match found.holds {
        true => "the certificate holds",
        false => "the certificate no longer holds",
    };
    format!("{lines}{verdict}\n")
}
