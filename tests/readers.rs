//! Properties of every reader: whatever a file holds, it is read or refused by name, without a panic
//! and without memory that its size does not justify.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod allocator;
mod checkpoint;

use std::fmt::Display;
use std::path::Path;

use allocator::peak;
use proptest::prelude::*;
use proptest::test_runner::{Config as Cases, RngSeed, TestRunner};
use reachcast::config::{Config, Overrides};
use reachcast::files::{StateReader, npy_bytes, npz_bytes, read_npz};
use reachcast::policy::Mlp;
use reachcast::policy::import;
use reachcast::race::log::{RaceLog, StepLog, arrays, races};
use reachcast::race::record::RaceRecord;
use reachcast::race::sweep::record::{PointResult, SweepRecord};
use reachcast::race::sweep::{Computed, Store};
use reachcast::scenario::record::Record;
use serde_json::json;

/// Damaged files for each reader; `PROPTEST_CASES` says otherwise.
const CASES: u32 = 500;
/// Memory that a reader may take beside a multiple of the file's size, bytes.
const ALLOWANCE: usize = 1 << 20;
/// What a byte of a file may become in memory: a digit of a list in JSON becomes a value.
const FACTOR: usize = 128;

/// What a reader says about the file at a path: whether it was read, or the refusal.
type Reader<'a> = &'a dyn Fn(&Path) -> Result<(), String>;

fn said<T>(result: Result<T, impl Display>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}

/// A change to a valid file.
#[derive(Clone, Debug)]
enum Damage {
    /// Other bytes altogether.
    Bytes(Vec<u8>),
    /// Cut off at a share of its length.
    Cut(f64),
    /// Single bits, at shares of the length.
    Flip(Vec<(f64, u8)>),
    /// A number of up to eight bytes in the place of others: a length, where it hits one.
    Number(f64, u64, usize),
    /// The start of one file and the end of another.
    Splice(f64, f64, usize),
    /// A part of the file once more.
    Repeat(f64, f64, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let share = || 0.0..1.0_f64;
    let number = prop_oneof![
        any::<u64>(),
        (0..64_u32).prop_map(|bit| 1 << bit),
        Just(u64::MAX),
        Just(i64::MAX as u64),
        Just(u64::from(u32::MAX)),
        Just(1 << 31),
    ];
    let length = prop_oneof![Just(1_usize), Just(2), Just(4), Just(8)];
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..600).prop_map(Damage::Bytes),
        share().prop_map(Damage::Cut),
        proptest::collection::vec((share(), 0..8_u8), 1..6).prop_map(Damage::Flip),
        (share(), number, length)
            .prop_map(|(at, number, length)| Damage::Number(at, number, length)),
        (share(), share(), 0..8_usize).prop_map(|(to, from, of)| Damage::Splice(to, from, of)),
        (share(), share(), 1..40_usize)
            .prop_map(|(at, part, times)| Damage::Repeat(at, part, times)),
    ]
}

impl Damage {
    /// The first of the `valid` files, damaged.
    fn apply(&self, valid: &[Vec<u8>]) -> Vec<u8> {
        let whole = &valid[0];
        let place = |share: f64, of: &[u8]| ((share * of.len() as f64) as usize).min(of.len());
        let mut bytes = whole.clone();
        match self {
            Self::Bytes(other) => bytes = other.clone(),
            Self::Cut(at) => bytes.truncate(place(*at, whole)),
            Self::Flip(bits) => {
                for (at, bit) in bits {
                    bytes[place(*at, whole)] ^= 1 << bit;
                }
            }
            Self::Number(at, number, length) => {
                let at = place(*at, whole);
                let end = (at + length).min(whole.len());
                bytes[at..end].copy_from_slice(&number.to_le_bytes()[..end - at]);
            }
            Self::Splice(to, from, of) => {
                let other = &valid[of % valid.len()];
                bytes.truncate(place(*to, whole));
                bytes.extend(&other[place(*from, other)..]);
            }
            Self::Repeat(at, part, times) => {
                let (begin, end) = (place(*at, whole), place((at + 0.1 * part).min(1.0), whole));
                bytes.splice(begin..begin, whole[begin..end].repeat(*times));
            }
        }
        bytes
    }
}

/// Reads `bytes` as the file `name`: no panic, no memory out of proportion, a refusal by name.
fn read(name: &str, bytes: &[u8], reader: Reader<'_>) -> Result<bool, TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let (said, most) = peak(|| reader(&path));
    prop_assert!(most <= ALLOWANCE + FACTOR * bytes.len(), "{most} bytes for {}", bytes.len());
    if let Err(message) = &said {
        prop_assert!(message.contains(name), "no `{name}` in: {message}");
    }
    // A reader reads: nothing new beside the file.
    prop_assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    Ok(said.is_ok())
}

/// The same cases in every run.
fn cases() -> Cases {
    Cases {
        cases: std::env::var("PROPTEST_CASES").map_or(CASES, |cases| cases.parse().unwrap()),
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..Cases::default()
    }
}

/// Damages `valid` files in every way, and counts what is read all the same.
fn holds(name: &str, valid: &[Vec<u8>], reader: Reader<'_>) {
    for (i, whole) in valid.iter().enumerate() {
        assert!(read(name, whole, reader).unwrap(), "file {i} is valid");
    }
    let taken = std::cell::Cell::new([0, 0]);
    let run = TestRunner::new(cases()).run(&damage(), |damage| {
        let read = read(name, &damage.apply(valid), reader)?;
        let mut counts = taken.get();
        counts[usize::from(read)] += 1;
        taken.set(counts);
        Ok(())
    });
    run.unwrap_or_else(|error| panic!("{name}: {error}"));
    let [refused, taken] = taken.get();
    println!("{name}: {refused} refused, {taken} read");
    assert!(refused > CASES / 4, "{name}: {refused} refused");
}

/// A file of the repository.
fn file(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

fn config(path: &Path) -> Result<(), String> {
    said(Config::load(path, &Overrides::default()))
}

#[test]
fn configurations() {
    let valid =
        ["race", "smoke", "double_integrator"].map(|name| file(&format!("configs/{name}.toml")));
    holds("damaged.toml", &valid, &config);
}

#[test]
fn policies() {
    let valid = [file("configs/policies/race_policy.safetensors")];
    holds("damaged.safetensors", &valid, &|path| said(Mlp::load(path)));
}

fn names() -> Vec<String> {
    ["a", "b", "c"].map(str::to_owned).to_vec()
}

fn states(path: &Path) -> Result<(), String> {
    said(StateReader::open(path, names()).and_then(StateReader::rest))
}

#[test]
fn arrays_of_states() {
    let one = npy_bytes(&[0.5; 60], [20, 3]);
    holds("damaged.npy", &[one, npy_bytes(&[1.0; 3], [1, 3])], &states);
}

#[test]
fn tables_of_states() {
    let row = "0.5,-1e-3,12\n".repeat(20);
    let valid = [format!("a,b,c\n{row}"), format!("# note\n{row}"), row];
    holds("damaged.csv", &valid.map(String::into_bytes), &states);
}

/// Two races in one file.
fn logs() -> Vec<u8> {
    let step = StepLog { tier: Some(1), check_margin: Some(0.5), ..StepLog::default() };
    let race = RaceLog { states: vec![[0.5; 12]; 4], steps: vec![step; 3] };
    npz_bytes(&arrays(&[race.clone(), race], 4)).unwrap()
}

fn log(path: &Path) -> Result<(), String> {
    let arrays = read_npz(path).map_err(|error| error.to_string())?;
    // What is wrong with the arrays is said where the path is known.
    said(races(&arrays).map_err(|problem| format!("{}: {problem}", path.display())))
}

#[test]
fn logs_of_races() {
    holds("damaged.npz", &[logs()], &log);
}

/// The same behind the checksums of the archive: each array in turn is damaged.
#[test]
fn arrays_within_logs() {
    let whole = entries(&logs());
    for (i, (name, array)) in whole.iter().enumerate().step_by(3) {
        let archive = |path: &Path| {
            let mut changed = whole.clone();
            changed[i].1 = std::fs::read(path).unwrap();
            let inner = path.with_extension("npz");
            std::fs::write(&inner, zipped(&changed)).unwrap();
            let said = log(&inner).map_err(|message| message.replace(".npz", ".npy"));
            std::fs::remove_file(&inner).unwrap();
            said
        };
        println!("{name}");
        holds("damaged.npy", std::slice::from_ref(array), &archive);
    }
}

/// Names and contents of an archive.
fn entries(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let count = archive.len();
    let entry = |i| {
        let mut file = archive.by_index(i).unwrap();
        let mut content = Vec::new();
        std::io::copy(&mut file, &mut content).unwrap();
        (file.name().unwrap().into_owned(), content)
    };
    (0..count).map(entry).collect()
}

fn zipped(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in entries {
        archive.start_file(name.as_str(), options).unwrap();
        std::io::Write::write_all(&mut archive, content).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn checkpoints() {
    let import = |path: &Path| said(import::read(path, &checkpoint::stated()));
    holds("damaged.pth", &[checkpoint::bytes("sequential.pth")], &import);
    let graphs = ["relu.onnx", "silu.onnx", "products.onnx"].map(checkpoint::bytes);
    let import = |path: &Path| said(import::read(path, &import::Request::default()));
    holds("damaged.onnx", &graphs, &import);
}

/// The pickle of a checkpoint behind the checksums of the archive.
#[test]
fn pickles_within_checkpoints() {
    let within = |path: &Path| {
        let inner = path.with_extension("pth");
        let content = checkpoint::with_pickle("sequential.pth", &std::fs::read(path).unwrap());
        std::fs::write(&inner, content).unwrap();
        let said = said(import::read(&inner, &checkpoint::stated()));
        std::fs::remove_file(&inner).unwrap();
        said.map_err(|message| message.replace(".pth", ".pkl"))
    };
    holds("damaged.pkl", &[checkpoint::pickle("sequential.pth")], &within);
}

/// A stored certificate, small.
fn certificate() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let words = "certify configs/double_integrator.toml -q --backend cpu --set global.draws=500 \
                 --set slice.x.step=0.4 --set slice.y.step=0.5 --out";
    let arguments = words.split_whitespace();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_reachcast"))
        .args(arguments)
        .arg(folder.path())
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()
        .unwrap();
    assert!(matches!(status.code(), Some(0 | 3)));
    std::fs::read(folder.path().join("certificate.json")).unwrap()
}

#[test]
fn certificates() {
    let certificate = certificate();
    let read = |path: &Path| {
        let said = std::fs::read_to_string(path).map_err(|error| error.to_string());
        let said = said.and_then(|text| said_record(&text));
        // The command line adds the path.
        said.map_err(|problem| format!("{}: {problem}", path.display()))
    };
    holds("damaged.json", std::slice::from_ref(&certificate), &read);
    // A change that is read leaves the record as it was.
    let record = Record::read(std::str::from_utf8(&certificate).unwrap()).unwrap();
    let mut runner = TestRunner::new(cases());
    let whole = [certificate];
    runner
        .run(&damage(), |damage| {
            let bytes = damage.apply(&whole);
            let found = std::str::from_utf8(&bytes).ok().and_then(|text| Record::read(text).ok());
            prop_assert!(found.is_none_or(|found| found == record));
            Ok(())
        })
        .unwrap();
}

fn said_record(text: &str) -> Result<(), String> {
    said(Record::read(text))
}

/// The stored point of a sweep, as a sweep that is taken up again reads it.
#[test]
fn points_of_sweeps() {
    let folder = tempfile::tempdir().unwrap();
    let (record, result) = sweep();
    let mut store = Store::open(folder.path(), &json!({}), record.clone()).unwrap();
    let hash = "a".repeat(64);
    store
        .point(hash.clone(), vec!["1".to_owned()], || {
            Ok(Computed { result: result.clone(), events: vec![] })
        })
        .unwrap();
    let name = format!("{hash}.json");
    let whole = std::fs::read(folder.path().join("points").join(&name)).unwrap();
    let read = |path: &Path| {
        std::fs::copy(path, folder.path().join("points").join(&name)).unwrap();
        let mut store = Store::open(folder.path(), &json!({}), record.clone()).unwrap();
        let computes = || -> reachcast::Result<Computed> { panic!("it is stored") };
        let stored = store.point(hash.clone(), vec!["1".to_owned()], computes);
        if stored.is_ok() {
            assert_eq!(store.record().points[0].result, result);
        }
        said(stored)
    };
    holds(&name, &[whole], &read);
}

/// A sweep without points, and what a point of it came to.
fn sweep() -> (SweepRecord, PointResult) {
    let record = json!({
        "schema": 1,
        "provenance": {
            "version": "0", "seed": 1, "generator": "g", "config": {}, "policy": "p",
            "policy_sha256": "0", "physics_sha256": "0", "backend": "cpu", "device": "d",
        },
        "starts": null, "noise_seeds": [], "judge": null,
        "axes": [{ "name": "epsilon", "values": ["1"] }],
        "total": 1, "points": [],
    });
    let point = json!({
        "of": "certificate", "deviation_scenarios": 159, "deviation_risk": 0.1,
        "deviation_bound": 0.25, "draws": 1000, "accepted": 20, "share_interval": [0.01, 0.03],
        "volume_interval": [0.1, 0.2], "conditional_risk": 0.3, "growth_scenarios": 159,
        "growth": "verified", "rounds": 3, "radius": 0.1, "holds": false, "beta_total": 0.004,
        "seconds": 0.5,
    });
    (serde_json::from_value(record).unwrap(), serde_json::from_value(point).unwrap())
}

/// Nesting far beyond what any of these files has.
#[test]
fn deep_nesting_is_refused() {
    let deep = 200_000;
    for (open, value, close) in
        [("[", "1", "]"), ("{a=", "1", "}"), ("a.", "b=1", ""), ("{\"a\":", "1", "}")]
    {
        let nested = [&open.repeat(deep), value, &close.repeat(deep)].concat();
        let keyed = if open == "a." { nested.clone() } else { format!("a = {nested}") };
        assert!(!read("deep.toml", keyed.as_bytes(), &config).unwrap(), "{open}");
        let header = format!("[{}b]\n", "a.".repeat(deep));
        assert!(!read("deep.toml", header.as_bytes(), &config).unwrap());
        for text in [&nested, &format!("{{\"schema\":1,\"digests\":{nested}}}")] {
            assert!(Record::read(text).is_err());
            assert!(serde_json::from_str::<SweepRecord>(text).is_err());
            assert!(serde_json::from_str::<RaceRecord>(text).is_err());
        }
    }
}

/// Entries whose names are paths are names: nothing is unpacked anywhere.
#[test]
fn names_in_archives_are_no_paths() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let mut hostile = entries(&logs());
    let target = folder.path().join("escaped.npy");
    for name in
        ["../escaped.npy", "/tmp/escaped.npy", "a/../../escaped.npy", target.to_str().unwrap()]
    {
        let content = hostile[0].1.clone();
        hostile.push((name.to_owned(), content));
    }
    let path = inner.join("hostile.npz");
    std::fs::write(&path, zipped(&hostile)).unwrap();
    let arrays = read_npz(&path).unwrap();
    assert!(arrays.contains_key("../escaped"));
    races(&arrays).unwrap();
    assert!(!target.exists() && !Path::new("/tmp/escaped.npy").exists());
    assert_eq!(std::fs::read_dir(&inner).unwrap().count(), 1);
}
