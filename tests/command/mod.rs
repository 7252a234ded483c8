//! The program from outside: its exit code, what it prints, and files of a test's own.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::process::Command;

use tempfile::TempDir;

/// Exit code, standard output and standard error of the program, run in the repository's folder.
pub(crate) fn reachcast(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    let output = command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Runs and expects exit code 0; standard output.
pub(crate) fn done(arguments: &[&str]) -> String {
    let (code, output, message) = reachcast(arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {message}");
    output
}

/// The JSON document that a command prints with `--json`.
pub(crate) fn document(arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&done(&[arguments, &["--json"]].concat())).unwrap()
}

/// Runs and expects exit code 2, nothing on standard output, and `words` in the message.
pub(crate) fn refused(arguments: &[&str], words: &[&str]) {
    let (code, output, message) = reachcast(arguments);
    assert_eq!((code, output.as_str()), (Some(2), ""), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no `{word}` in: {message}");
    }
}

/// A folder of its own with a way to name files in it.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Names of what is in it.
    pub(crate) fn entries(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
}
