//! The command `certify`: a certificate, its tables and its report in one folder.

use std::fmt::Write;
use std::path::Path;

use super::inputs::{inputs, networks};
use super::options::Global;
use super::progress::Progress;
use super::{Outcome, devices, folder_of, report, summary};
use crate::config::{Config, PolicySource, copy_name};
use crate::error::Result;
use crate::files::{Existing, MANIFEST, Staged, check_room, is_free, json, make_way, npy_bytes};
use crate::model::Plant;
use crate::model::text::NetworkFile;
use crate::scenario;
use crate::scenario::counterexamples::{COUNTEREXAMPLES, REPLAYED, replayed_csv, starts_csv};
use crate::scenario::record::{DeviationRecord, Record};
use crate::scenario::settings::Settings;
use crate::scenario::{BoxRecord, check_settings};

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-out";
/// Rollouts whose states would take as many numbers as all that pictures show.
const PICTURED: usize = 40;
/// Name of the stored certificate.
pub(super) const CERTIFICATE: &str = "certificate.json";
/// Name of the copy of the network, which makes the folder self-contained.
pub(super) const POLICY: &str = "policy.safetensors";

/// Certifies what the configuration asks for.
pub(super) fn run(global: &Global, path: &Path) -> Result<Outcome> {
    let config = Config::load(path, &global.overrides())?;
    let policy = config.policy_source(folder_of(path))?;
    let out = global.folder(DEFAULT_OUT);
    inputs(path, &policy, networks(&config)).spare_folder(&out)?;
    let manifest = manifest(&config, &policy)?;
    let work = Certify { global, config: &config, out: &out, manifest: &manifest };
    let (record, mut staged) = work.run(&config.plant(&policy)?)?;
    staged.add(MANIFEST, manifest.as_bytes())?;
    stage(&mut staged, &record, &policy, &config.networks)?;
    // Again: the work may have taken hours.
    match global.existing {
        Existing::Kept => is_free(&out, &manifest).map(drop)?,
        Existing::Replaced => make_way(&out, &manifest)?,
    }
    let files = staged.publish()?;
    report(global, &record, || summary::text(&record, &files))?;
    Ok(if record.holds { Outcome::Done } else { Outcome::NotObtained })
}

/// What the folder of a certificate says that it holds: the same for a run that repeats it.
fn manifest(config: &Config, policy: &PolicySource) -> Result<String> {
    let digest = match policy {
        PolicySource::Network { network, .. } => Some(network.digest()),
        PolicySource::Formula(_) => None,
    };
    let mut work = serde_json::json!({ "config": config.to_json()?, "policy_sha256": digest });
    let networks = config.networks.iter().map(|file| file.network.digest());
    let networks: Vec<String> = networks.collect();
    if !networks.is_empty() {
        work["networks_sha256"] = networks.into();
    }
    json(MANIFEST, &serde_json::json!({ "certificate": work }))
}

/// The command for a plant.
struct Certify<'a> {
    global: &'a Global,
    config: &'a Config,
    out: &'a Path,
    manifest: &'a str,
}

impl Certify<'_> {
    /// The certificate, and the folder that its files are staged for.
    fn run(self, plant: &Plant) -> Result<(Record, Staged)> {
        let settings = self.config.settings(&plant.model.states)?;
        check_settings(&settings).map_err(|error| self.config.placed(error))?;
        let stored = self.config.to_json()?;
        if self.global.existing == Existing::Kept {
            is_free(self.out, self.manifest)?;
        }
        let backend = devices::open(self.global)?;
        let progress = Progress::new(self.global);
        // Before the work: a folder that cannot be written to would waste it.
        let staged = Staged::new(self.out)?;
        check_room(self.out, estimate(&settings))?;
        let program = backend.prepare(plant)?;
        let record = scenario::certify(&program, &settings, stored, &progress);
        let mut record = record.map_err(|error| self.config.placed(error))?;
        record.timing.threads = devices::threads(self.global);
        devices::note_events(self.global, &backend);
        progress.check()?;
        Ok((record.sealed()?, staged))
    }
}

/// About what the files of the folder take, bytes: a number takes some 20 characters in a text.
fn estimate(settings: &Settings) -> u64 {
    let [x, y] = settings.slice_size();
    let states = PICTURED * (settings.spec.horizon as usize + 1);
    (1 << 20) + 20 * (8 * x * y + settings.state.len() * states) as u64
}

/// Writes all files of the folder, the certificate itself last.
fn stage(
    staged: &mut Staged,
    record: &Record,
    policy: &PolicySource,
    networks: &[NetworkFile],
) -> Result<()> {
    if let PolicySource::Network { bytes, .. } = policy {
        staged.add(POLICY, bytes)?;
    }
    for (i, file) in networks.iter().enumerate() {
        staged.add(copy_name(i), &file.bytes)?;
    }
    for (name, bytes) in derived_files(record) {
        staged.add(name, &bytes)?;
    }
    staged.add(CERTIFICATE, json(CERTIFICATE, record)?.as_bytes())
}

/// The files that say again what the record says.
pub(super) fn derived_files(record: &Record) -> Vec<(&'static str, Vec<u8>)> {
    let slice = &record.slice;
    let shape = [slice.y.values.len(), slice.x.values.len()];
    let mut files = vec![
        ("slice.npy", npy_bytes(&slice.check_margin, shape)),
        ("deviation.csv", deviation_csv(&record.deviation).into_bytes()),
        ("report.html", crate::report::html(record).into_bytes()),
    ];
    files.extend(counterexamples(record));
    files
}

/// The tables of starts and pairs that fail, each where there are any.
fn counterexamples(record: &Record) -> Vec<(&'static str, Vec<u8>)> {
    let Some(BoxRecord { parameters, starts, pairs, .. }) = &record.whole_box else {
        return Vec::new();
    };
    let (states, controls) = (&record.system.states, &record.system.controls);
    let mut files = Vec::new();
    if !starts.is_empty() {
        files.push((COUNTEREXAMPLES, starts_csv(states, parameters, starts).into_bytes()));
    }
    if !pairs.is_empty() {
        let table = replayed_csv([states, controls], parameters, pairs);
        files.push((REPLAYED, table.into_bytes()));
    }
    files
}

/// The bounds of each step; the column `exact` is empty for a system that is not linear.
fn deviation_csv(deviation: &DeviationRecord) -> String {
    let mut text = "step,bound,largest,exact\n".to_owned();
    for (step, (bound, largest)) in deviation.bound.iter().zip(&deviation.largest).enumerate() {
        let exact = deviation.exact.as_ref().and_then(|exact| exact.get(step));
        let exact = exact.map(f64::to_string).unwrap_or_default();
        // A String takes whatever is written to it.
        let _ = writeln!(text, "{step},{bound},{largest},{exact}");
    }
    text
}
