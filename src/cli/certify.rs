//! The command `certify`: a certificate, its tables and its report in one folder.

use std::io::Write;
use std::path::Path;

use super::inputs::{inputs, networks};
use super::options::Global;
use super::output::plain;
use super::progress::Progress;
use super::{Outcome, caveats, devices, folder_of, report, summary};
use crate::certificate::{Certificate, manifest};
use crate::config::{Config, PolicySource};
use crate::error::Result;
use crate::files::{
    COST_COPIES, Existing, RECORD_BYTES, Staged, check_room, is_free, make_way, read,
};
use crate::model::Plant;
use crate::scenario;
use crate::scenario::check_settings;
use crate::scenario::record::Record;
use crate::scenario::settings::Settings;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-out";
/// Rollouts whose states would take as many numbers as all that pictures show.
const PICTURED: usize = 40;

/// Certifies what the configuration asks for.
pub(super) fn run(global: &Global, path: &Path) -> Result<Outcome> {
    let config = Config::load(path, &global.overrides())?;
    let policy = config.policy_source(folder_of(path))?;
    let out = global.folder(DEFAULT_OUT);
    let named = config.planned_files(folder_of(path))?;
    inputs(path, &policy, networks(&config).chain(named)).spare_folder(&out)?;
    let manifest = manifest_of(&config, &policy)?;
    let work = Certify { global, config: &config, out: &out, manifest: &manifest };
    let plant = config.plant(&policy)?;
    caveats::say(global, &config, &plant);
    let (record, mut staged) = work.run(&plant)?;
    let network = match policy {
        PolicySource::Network { bytes, .. } => Some(bytes),
        PolicySource::Formula(_) => None,
    };
    let networks = config.networks.iter().map(|file| file.bytes.clone()).collect();
    let certificate = Certificate::of_files(record, network, networks, manifest.clone());
    certificate.stage(&mut staged)?;
    let costs = cost_copies(&config, folder_of(path), &out)?;
    // Again: the work may have taken hours.
    match global.existing {
        Existing::Kept => is_free(&out, &manifest).map(drop)?,
        Existing::Replaced => make_way(&out, &manifest)?,
    }
    let mut files = costs.map_or(Ok(Vec::new()), Staged::publish)?;
    files.extend(staged.publish()?);
    let record = certificate.record();
    report(global, record, || summary::text(record, &files))?;
    Ok(if record.holds { Outcome::Done } else { Outcome::NotObtained })
}

/// What the folder says that it holds.
fn manifest_of(config: &Config, policy: &PolicySource) -> Result<String> {
    let digest = match policy {
        PolicySource::Network { network, .. } => Some(network.digest()),
        PolicySource::Formula(_) => None,
    };
    let networks = config.networks.iter().map(|file| file.network.digest()).collect();
    manifest(&config.to_json()?, digest, networks)
}

/// Copies of the files that costs name, below `out`; none where there are no such files. One that is not
/// there, which only plans would miss, is told.
fn cost_copies(config: &Config, folder: &Path, out: &Path) -> Result<Option<Staged>> {
    let named = config.planned_files(folder)?;
    if named.is_empty() {
        return Ok(None);
    }
    let mut staged = Staged::within(out, COST_COPIES)?;
    for (number, path) in (1..).zip(&named) {
        match read(path, RECORD_BYTES) {
            Ok(bytes) => staged.add(&copy_name(number, path), &bytes)?,
            Err(error) => {
                let path = plain(&path.display().to_string());
                // Whatever becomes of standard error, the certificate stands.
                let _ = writeln!(
                    std::io::stderr(),
                    "note: {path}, which costs name, is not copied: {error}"
                );
            }
        }
    }
    Ok(Some(staged))
}

/// The name of the copy of the file number `number` that costs name.
fn copy_name(number: usize, path: &Path) -> String {
    let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default();
    let end =
        ["csv", "npy", "safetensors"].into_iter().find(|known| end.eq_ignore_ascii_case(known));
    format!("file_{number}.{}", end.unwrap_or("csv"))
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
