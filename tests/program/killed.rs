//! Runs killed at random moments: what is there is whole, and the next run gives the same bytes.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use parquet::file::reader::{FileReader, SerializedFileReader};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::files::{npz_bytes, read_npz};
use reachcast::policy::Mlp;
use reachcast::race::record::RaceRecord;
use reachcast::race::sweep::record::SweepRecord;
use reachcast::race::{race_html, sweep_html};
use reachcast::report::html;
use reachcast::scenario::record::Record;
use serde_json::{Value, json};

/// Runs that are killed, of each command.
const KILLS: usize = 18;
/// Attempts: some runs end before they are killed.
const MOST_RUNS: usize = 200;
/// Longest wait for a run to begin to write.
const PATIENCE: Duration = Duration::from_secs(30);
/// Durations, whatever they are part of, and digests over what holds them.
const TIMED: [&str; 10] = [
    "wall_seconds",
    "threads",
    "mean_seconds",
    "p99_seconds",
    "most_seconds",
    "latency",
    "batch_seconds",
    "content_sha256",
    "timing.wall_seconds",
    "timing.threads",
];
/// The same as columns of a sweep's table.
const TIMED_COLUMNS: [&str; 6] =
    ["step_ms_median", "step_ms_p95", "step_ms_p99", "batch_ms", "seconds", "timed_steps"];

/// A command with its arguments, but for `--out`.
struct Work<'a> {
    arguments: &'a [&'a str],
    /// What `--out` names in a folder: a folder, or a file.
    out: &'a str,
}

impl Work<'_> {
    fn start(&self, folder: &Path) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
        command.args(self.arguments).args(["--backend", "cpu", "-q", "--out"]);
        command.arg(folder.join(self.out)).current_dir(env!("CARGO_MANIFEST_DIR"));
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Runs to the end; the time that it took.
    fn finish(&self, folder: &Path) -> Duration {
        let begun = Instant::now();
        let output = self.start(folder).wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(0 | 3)), "{message}");
        begun.elapsed()
    }

    /// Whether the run was killed after `delay` rather than at its end. Half of the runs, `writing`,
    /// count the delay from their first new file.
    fn kill(&self, folder: &Path, delay: Duration, writing: bool) -> bool {
        let before = entries(folder).len();
        let mut child = self.start(folder);
        let begun = Instant::now();
        while writing
            && entries(folder).len() <= before
            && child.try_wait().unwrap().is_none()
            && begun.elapsed() < PATIENCE
        {
            std::thread::sleep(Duration::from_micros(200));
        }
        std::thread::sleep(delay);
        // SIGKILL: nothing of the program runs any more.
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        match output.status.signal() {
            Some(9) => true,
            _ => {
                assert!(matches!(output.status.code(), Some(0 | 3)), "{message}");
                false
            }
        }
    }
}

/// The files below `folder`, by their paths from there.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(inner) = open.pop() {
        // A temporary file may be gone between two looks.
        for entry in fs::read_dir(inner).into_iter().flatten().flatten() {
            match entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                true => open.push(entry.path()),
                false => files.push(entry.path().strip_prefix(folder).unwrap().to_owned()),
            }
        }
    }
    files.sort();
    files
}

fn is_temporary(path: &Path) -> bool {
    path.file_name().unwrap().to_str().unwrap().starts_with(".reachcast-")
}

/// The document without what is measured anew.
fn untimed(mut document: Value) -> Value {
    match &mut document {
        Value::Object(fields) => {
            for (key, value) in fields.iter_mut() {
                *value =
                    if TIMED.contains(&key.as_str()) { json!(0) } else { untimed(value.take()) };
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| *item = untimed(item.take())),
        _ => {}
    }
    document
}

/// What a file says, but for what is measured anew; it has to be whole.
fn content(folder: &Path, path: &Path) -> Vec<u8> {
    let (full, bytes) = (folder.join(path), fs::read(folder.join(path)).unwrap());
    let text = || String::from_utf8(bytes.clone()).unwrap();
    let name = path.file_name().unwrap().to_str().unwrap();
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("json") => {
            if name == "certificate.json" {
                Record::read(&text()).unwrap();
            }
            untimed(serde_json::from_str(&text()).unwrap()).to_string().into_bytes()
        }
        Some("npz") => {
            let arrays = read_npz(&full).unwrap();
            let kept = arrays.iter().filter(|(name, _)| *name != "seconds" && *name != "sha256");
            let kept: Vec<_> = kept.map(|(name, array)| (name.as_str(), array.clone())).collect();
            npz_bytes(&kept).unwrap()
        }
        Some("html") => {
            assert!(text().trim_end().ends_with("</html>"), "{name}");
            Vec::new()
        }
        Some("csv") if name == "sweep.csv" => untimed_rows(&bytes),
        Some("parquet") => {
            let file = SerializedFileReader::new(fs::File::open(&full).unwrap()).unwrap();
            let mut rows = Vec::new();
            for row in file.get_row_iter(None).unwrap() {
                let row = row.unwrap();
                let columns = row.get_column_iter();
                let kept = columns.filter(|(name, _)| !TIMED_COLUMNS.contains(&name.as_str()));
                rows.extend(kept.flat_map(|(name, field)| format!("{name}={field};").into_bytes()));
            }
            rows
        }
        Some("safetensors") => {
            Mlp::from_bytes(&bytes).unwrap();
            bytes
        }
        _ => bytes,
    }
}

/// The rows of a sweep's table without what is measured anew.
fn untimed_rows(bytes: &[u8]) -> Vec<u8> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(bytes);
    let rows: Vec<csv::StringRecord> = reader.records().map(|row| row.unwrap()).collect();
    let timed: Vec<bool> = rows[0].iter().map(|name| TIMED_COLUMNS.contains(&name)).collect();
    let mut kept = Vec::new();
    for row in &rows {
        let cells = row.iter().zip(&timed).filter(|(_, timed)| !**timed);
        kept.extend(cells.flat_map(|(cell, _)| format!("{cell};").into_bytes()));
    }
    kept
}

/// The page is the one that the record beside it gives: no older one, no other.
fn check_page(folder: &Path) {
    let read = |name: &str| fs::read_to_string(folder.join(name));
    let page = read("report.html").unwrap();
    let expected = if let Ok(text) = read("certificate.json") {
        html(&Record::read(&text).unwrap())
    } else if let Ok(text) = read("results.json") {
        race_html(&serde_json::from_str::<RaceRecord>(&text).unwrap())
    } else {
        sweep_html(&serde_json::from_str::<SweepRecord>(&read("sweep.json").unwrap()).unwrap())
    };
    assert!(page == expected, "the page is not that of the record");
}

/// Kills runs of `work` at random moments and then lets one end: its files have to be those of a run
/// that nobody disturbed. `fresh` of the runs begin in an empty folder.
fn survives(work: &Work<'_>, seed: u64, fresh: f64) {
    let folder = tempfile::tempdir().unwrap();
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    [&whole, &killed].into_iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let duration = work.finish(&whole);
    let mut draw = StdRng::seed_from_u64(seed);
    let (mut kills, mut left) = (0, 0);
    for run in 0..MOST_RUNS {
        let writing = run % 2 == 0;
        let most = if writing { duration / 20 } else { duration };
        let delay = most.mul_f64(draw.random());
        kills += usize::from(work.kill(&killed, delay, writing));
        let found = entries(&killed);
        left += found.iter().filter(|path| is_temporary(path)).count();
        for path in found.iter().filter(|path| !is_temporary(path)) {
            content(&killed, path);
        }
        if kills >= KILLS {
            break;
        }
        if draw.random::<f64>() < fresh {
            fs::remove_dir_all(&killed).unwrap();
            fs::create_dir(&killed).unwrap();
        }
    }
    println!("{kills} runs of {:?} were killed; temporary files seen: {left}", work.arguments[0]);
    assert!(kills >= KILLS, "{kills} runs were killed");
    work.finish(&killed);
    assert_eq!(entries(&killed), entries(&whole));
    for path in entries(&whole) {
        assert!(content(&killed, &path) == content(&whole, &path), "{}", path.display());
    }
    if work.out == "out" {
        check_page(&killed.join("out"));
    }
}

#[test]
fn a_killed_certify_leaves_no_trace() {
    let arguments = ["certify", "configs/smoke.toml", "--set", "global.draws=20000"];
    survives(&Work { arguments: &arguments, out: "out" }, 1, 0.4);
}

#[test]
fn a_killed_race_goes_on() {
    let mut arguments =
        vec!["race", "configs/smoke.toml", "--starts", "6", "--noise-seeds", "2", "--controllers"];
    arguments.push("hybrid,mppi,policy,mppi-cbf");
    for key in ["race.steps=20", "race.hybrid.recovery.samples=24", "race.hybrid.fast.samples=24"] {
        arguments.extend(["--set", key]);
    }
    survives(&Work { arguments: &arguments, out: "out" }, 2, 0.2);
}

#[test]
fn a_killed_sweep_goes_on() {
    let mut arguments = vec!["sweep", "configs/smoke.toml", "--starts", "4", "--set"];
    arguments.extend(["race.steps=20", "--samples", "8,16,32", "--horizon", "5,10"]);
    survives(&Work { arguments: &arguments, out: "out" }, 3, 0.2);
}

#[test]
fn a_killed_import_leaves_no_trace() {
    let file = "tests/fixtures/checkpoints/sequential.pth";
    let arguments = ["policy", "import", file, "--activation", "relu"];
    survives(&Work { arguments: &arguments, out: "policy.safetensors" }, 4, 0.5);
}
