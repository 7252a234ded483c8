//! A certificate as a folder: its record, the networks that it rests on, its tables, its report.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::files::{MANIFEST, NETWORK_COPIES, Staged, is_free, json, npy_bytes};
use crate::model::{Law, Plant};
use crate::policy::Mlp;
use crate::scenario::BoxRecord;
use crate::scenario::counterexamples::{COUNTEREXAMPLES, REPLAYED, replayed_csv, starts_csv};
use crate::scenario::record::{DeviationRecord, Record};

/// Name of the stored certificate.
pub const CERTIFICATE: &str = "certificate.json";
/// Name of the copy of the policy's network, which makes the folder self-contained.
pub const POLICY: &str = "policy.safetensors";

/// A record with the networks that it rests on, as files.
///
/// ```
/// use reachcast::backend::Backend;
/// use reachcast::certificate::Certificate;
/// use reachcast::model::Plant;
/// use reachcast::rollout::RolloutSpec;
/// use reachcast::scenario::settings::Settings;
/// use reachcast::scenario::{Unwatched, certify};
/// use reachcast::system::{BangBang, DoubleIntegrator};
///
/// let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
/// let backend = Backend::cpu()?;
/// let mut settings = Settings::new(&plant.model, [0.9, 0.0], RolloutSpec::new(40, 0.99)?)?;
/// settings.global.draws = 2000;
/// let record = certify(&backend.prepare(&plant)?, &settings, "a tour".into(), &Unwatched)?;
///
/// let folder = std::env::temp_dir().join("reachcast-certificate-of-a-tour");
/// let files = Certificate::of(&plant, record)?.write(&folder)?;
/// assert!(files.iter().any(|file| file.ends_with("report.html")));
/// # std::fs::remove_dir_all(&folder).unwrap();
/// # Ok::<(), reachcast::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Certificate {
    record: Record,
    policy: Option<Vec<u8>>,
    networks: Vec<Vec<u8>>,
    manifest: String,
}

impl Certificate {
    /// The certificate `record` of `plant`, with the networks of the plant: that of its policy, and those
    /// that its formulas call, in the order of step, target, constraint and policy.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if the record has no JSON form.
    pub fn of(plant: &Plant, record: Record) -> Result<Self> {
        let (policy, called) = (plant.controller.network(), called(plant));
        let digests: Vec<String> = called.iter().map(|network| network.digest()).collect();
        let config = &record.provenance.config;
        let manifest = manifest(config, policy.map(Mlp::digest), digests)?;
        let networks = called.iter().map(|network| network.to_bytes()).collect();
        Ok(Self { record: record.sealed()?, policy: policy.map(Mlp::to_bytes), networks, manifest })
    }

    /// A sealed record with the bytes of its networks' files, in the folder that `manifest` describes.
    pub(crate) fn of_files(
        record: Record,
        policy: Option<Vec<u8>>,
        networks: Vec<Vec<u8>>,
        manifest: String,
    ) -> Self {
        Self { record, policy, networks, manifest }
    }

    /// Its record.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Writes the folder, all files or none; the paths of the files.
    ///
    /// # Errors
    /// [`crate::Error::File`] where other results are there, [`crate::Error::Write`] with the system's reason.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        is_free(folder, &self.manifest)?;
        let mut staged = Staged::new(folder)?;
        self.stage(&mut staged)?;
        staged.publish()
    }

    /// Puts all files into `staged`, the certificate itself last.
    ///
    /// # Errors
    /// [`crate::Error::Write`] with the system's reason.
    pub(crate) fn stage(&self, staged: &mut Staged) -> Result<()> {
        staged.add(MANIFEST, self.manifest.as_bytes())?;
        let copies = NETWORK_COPIES.iter().copied().zip(&self.networks);
        for (name, bytes) in self.policy.iter().map(|bytes| (POLICY, bytes)).chain(copies) {
            staged.add(name, bytes)?;
        }
        for (name, bytes) in derived_files(&self.record) {
            staged.add(name, &bytes)?;
        }
        staged.add(CERTIFICATE, json(CERTIFICATE, &self.record)?.as_bytes())
    }
}

/// What the folder of a certificate says that it holds: the same for a run that repeats it.
///
/// # Errors
/// [`crate::Error::Invalid`] if a value has no JSON form.
pub(crate) fn manifest(
    config: &serde_json::Value,
    policy: Option<String>,
    networks: Vec<String>,
) -> Result<String> {
    let mut work = serde_json::json!({ "config": config, "policy_sha256": policy });
    if !networks.is_empty() {
        work["networks_sha256"] = networks.into();
    }
    json(MANIFEST, &serde_json::json!({ "certificate": work }))
}

/// The networks that formulas of `plant` call, each once.
fn called(plant: &Plant) -> Vec<&Mlp> {
    let model = &plant.model;
    let of_policy = match &plant.controller.law {
        Law::Formula(graph) => [Some(graph), None],
        Law::Network { observe, act, .. } => [observe.as_ref(), act.as_ref()],
    };
    let graphs = [&model.step, &model.target, &model.constraint].into_iter();
    let calls = graphs.chain(of_policy.into_iter().flatten()).flat_map(|graph| &graph.calls);
    let mut networks: Vec<&Mlp> = Vec::new();
    for network in calls.map(|call| &*call.network) {
        if !networks.contains(&network) {
            networks.push(network);
        }
    }
    networks
}

/// The files that say again what the record says.
pub(crate) fn derived_files(record: &Record) -> Vec<(&'static str, Vec<u8>)> {
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
