//! Folders that cannot be written to and disks that are full: said before the work, and survived.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A small file system of its own, which goes with the test.
struct Disk {
    at: PathBuf,
    _folder: TempDir,
}

impl Disk {
    /// A disk of `size`, as `mount` has it; none where mounting is refused.
    fn new(size: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("disk");
        fs::create_dir(&at).unwrap();
        let size = format!("size={size}");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "tmpfs"])
            .arg(&at)
            .output()
            .is_ok_and(|output| output.status.success());
        if !mounted {
            println!("SKIPPED: mounting is refused");
        }
        mounted.then_some(Self { at, _folder: folder })
    }

    /// Mounts it again with these options.
    fn remount(&self, options: &str) {
        let options = format!("remount,{options}");
        let done = Command::new("mount").args(["-o", &options]).arg(&self.at).status().unwrap();
        assert!(done.success());
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        Command::new("umount").arg(&self.at).status().ok();
    }
}

/// A command with its arguments, and what names its output.
struct Work {
    arguments: Vec<String>,
    flag: &'static str,
    /// What the flag is given, in the folder.
    name: &'static str,
    /// Whether it works for long or writes much: an error has to come first.
    long: bool,
}

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

/// Every command that writes; `certificate` is one that `query` asks.
fn all(certificate: &Path) -> Vec<Work> {
    let work = |text: &str, flag, name, long| Work { arguments: words(text), flag, name, long };
    let query = format!(
        "query {} --states configs/race_starts_500.csv --backend cpu",
        certificate.display()
    );
    vec![
        work(
            "certify configs/smoke.toml --backend cpu --set global.draws=100000000000",
            "--out",
            "out",
            true,
        ),
        work(
            "race configs/smoke.toml --backend cpu --controllers mppi --set race.mppi.samples=500000",
            "--out",
            "out",
            true,
        ),
        work("sweep configs/smoke.toml --backend cpu --samples 500000", "--out", "out", true),
        work(&query, "--out", "out", false),
        work(
            "rollout configs/smoke.toml --backend cpu --starts configs/race_starts_500.csv",
            "--measures",
            "measures.npy",
            false,
        ),
        work(
            "policy import tests/fixtures/checkpoints/sequential.pth --activation relu",
            "--out",
            "policy.safetensors",
            false,
        ),
        work("bench --quick --backend cpu", "--out", "out", true),
        work("bench --backend cpu", "--export", "out", true),
    ]
}

impl Work {
    fn run(&self, folder: &Path) -> Output {
        let mut command = Command::new("timeout");
        command.args(["60", env!("CARGO_BIN_EXE_reachcast")]).args(&self.arguments);
        command.arg(self.flag).arg(folder.join(self.name));
        command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
    }

    /// Expects exit code 1, nothing on standard output, and `words` in the message.
    fn fails(&self, folder: &Path, words: &[&str]) -> String {
        let output = self.run(folder);
        let message = String::from_utf8(output.stderr).unwrap();
        let case = self.arguments.join(" ");
        assert_eq!(output.status.code(), Some(1), "{case}: {message}");
        assert!(output.stdout.is_empty(), "{case}");
        for word in words {
            assert!(message.contains(word), "{case}: no `{word}` in: {message}");
        }
        message
    }
}

/// A certificate of the smoke configuration.
fn certificate() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("certificate");
    let certify = words("certify configs/smoke.toml --backend cpu -q");
    let work = Work { arguments: certify, flag: "--out", name: "certificate", long: false };
    assert!(matches!(work.run(folder.path()).status.code(), Some(0 | 3)));
    (folder, out)
}

/// Names of what is in the folder; a folder that a refused command took away again has nothing.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn folders_that_cannot_be_written_to() {
    let (_kept, certificate) = certificate();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "mine").unwrap();
    for work in all(&certificate) {
        // Nobody writes there, root included; a file is no folder, for anybody.
        for place in [Path::new("/proc"), &folder.path().join("file")] {
            let place = place.to_str().unwrap();
            work.fails(Path::new(place), &["cannot write", place]);
        }
    }
    assert_eq!(fs::read(folder.path().join("file")).unwrap(), b"mine");
    let Some(disk) = Disk::new("4m") else { return };
    fs::create_dir(disk.at.join("out")).unwrap();
    disk.remount("ro");
    let at = disk.at.to_str().unwrap();
    for work in all(&certificate) {
        let remedy = "make it writable, or write to another folder";
        work.fails(&disk.at, &["cannot write", at, "Read-only file system", remedy]);
    }
}

#[test]
fn disks_that_are_full_from_the_start() {
    let (_kept, certificate) = certificate();
    let Some(disk) = Disk::new("64k") else { return };
    for work in all(&certificate).iter().filter(|work| work.long) {
        work.fails(&disk.at, &[disk.at.to_str().unwrap(), "need about", "are free", "make room"]);
    }
    // Whatever was begun, nothing has a final name.
    let left: Vec<String> = names(&disk.at).into_iter().filter(|name| name != "out").collect();
    assert!(left.is_empty(), "{left:?}");
    fs::write(disk.at.join("fill"), vec![0; 64 << 10]).ok();
    for work in all(&certificate) {
        work.fails(&disk.at, &[disk.at.to_str().unwrap(), "make room there"]);
    }
}

/// The figures of the message are those of the work and of the disk.
#[test]
fn what_is_needed_and_what_is_free_is_said() {
    let Some(disk) = Disk::new("8m") else { return };
    // 100,000 races of 100 steps: about 1.2 GB.
    let race = "race configs/smoke.toml --backend cpu --controllers mppi --starts 100000";
    let work = |text: &str, flag, name| Work { arguments: words(text), flag, name, long: true };
    let race = work(&format!("{race} --set race.steps=100"), "--out", "out");
    let message = race.fails(&disk.at, &["the results need about", "are free"]);
    let need = message.split("need about ").nth(1).unwrap().split(' ').next().unwrap();
    let need: f64 = need.parse().unwrap();
    assert!((1100.0..1300.0).contains(&need) && message.contains(" MiB of room"), "{message}");
    assert!(message.contains("KiB are free"), "{message}");
    // A million starts, in a file with a hole.
    let folder = tempfile::tempdir().unwrap();
    let starts = folder.path().join("starts.npy");
    let mut header = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    header.extend(b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 12), }");
    header.resize(127, b' ');
    header.push(b'\n');
    fs::write(&starts, header).unwrap();
    fs::OpenOptions::new().write(true).open(&starts).unwrap().set_len(128 + 48_000_000).unwrap();
    let rollout = format!("rollout configs/smoke.toml --backend cpu --starts {}", starts.display());
    work(&rollout, "--measures", "measures.csv").fails(&disk.at, &["need about", "are free"]);
}

/// A run that is taken up again looks at the folder as well before it works.
#[test]
fn a_folder_that_became_read_only() {
    let Some(disk) = Disk::new("8m") else { return };
    let race = |controllers: &str| {
        let text = "race configs/smoke.toml --backend cpu -q --starts 8 --set race.steps=10 \
                    --set race.mppi.samples=500000 --controllers";
        let arguments = words(&format!("{text} {controllers}"));
        Work { arguments, flag: "--out", name: "out", long: true }
    };
    assert!(race("policy").run(&disk.at).status.success());
    disk.remount("ro");
    race("policy,mppi").fails(&disk.at, &["cannot write", "Read-only file system", "writable"]);
}

/// A disk that fills up between the first look and the last file.
#[test]
fn a_disk_that_fills_up_loses_nothing() {
    let Some(disk) = Disk::new("6m") else { return };
    let race = "race configs/smoke.toml --backend cpu -q --controllers mppi,policy,mppi-cbf --starts 40 \
                --set race.steps=40 --set race.mppi.samples=64 --set race.cbf.samples=64";
    let work = Work { arguments: words(race), flag: "--out", name: "out", long: false };
    let elsewhere = tempfile::tempdir().unwrap();
    assert!(work.run(elsewhere.path()).status.success());
    let out = disk.at.join("out");
    let fill = disk.at.join("fill");
    // Room for the first look is there; it goes as soon as the first batch is.
    let mut child = {
        let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
        command.args(&work.arguments).arg("--out").arg(&out);
        command.stderr(std::process::Stdio::piped());
        command.current_dir(env!("CARGO_MANIFEST_DIR")).spawn().unwrap()
    };
    while !out.join("races").exists() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    fs::write(&fill, vec![0; 6 << 20]).ok();
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    for word in ["cannot write", "out", "No space left", "make room there"] {
        assert!(message.contains(word), "no `{word}` in: {message}");
    }
    let whole = elsewhere.path().join("out/races");
    for name in names(&out.join("races")) {
        assert!(whole.join(&name).exists(), "{name} is left");
    }
    assert!(!out.join("results.json").exists());
    fs::remove_file(&fill).unwrap();
    let output = work.run(&disk.at);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |folder: &Path| fs::read(folder.join("results.json")).unwrap();
    assert!(read(&out) == read(&elsewhere.path().join("out")));
    assert!(names(&out).iter().all(|name| !name.starts_with('.')));
}
