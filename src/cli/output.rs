//! What a command says in the end: its outcome, and its report on standard output.

use std::io::Write;
use std::path::Path;

use serde::Serialize;

use super::options::Global;
use crate::error::{Error, Result};
use crate::files::json;

/// Version of the layout of each [`Document`].
const SCHEMA: u32 = 1;

/// What a command that ran to its end came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All that was asked for.
    Done,
    /// The claim asked for was not obtained.
    NotObtained,
}

/// A document of a command that is no record with a version of its own.
#[derive(Serialize)]
pub(crate) struct Document<'a, T> {
    schema: u32,
    #[serde(flatten)]
    content: &'a T,
}

/// `content` with the version of its layout.
pub(crate) fn document<T>(content: &T) -> Document<'_, T> {
    Document { schema: SCHEMA, content }
}

/// Prints `value` as JSON with `--json`, nothing with `-q`, else `text`.
pub(crate) fn report(
    global: &Global,
    value: &impl Serialize,
    text: impl FnOnce() -> String,
) -> Result<()> {
    let text = match (global.common.json, global.common.quiet) {
        (true, _) => json("--json", value)?,
        (false, true) => return Ok(()),
        (false, false) => plain(&text()),
    };
    let mut output = std::io::stdout().lock();
    match output.write_all(text.as_bytes()).and_then(|()| output.flush()) {
        // Whoever closed the pipe has read enough.
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::Write { path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

/// `text` for a terminal: what a name from a file could steer it with is replaced, line breaks and
/// tabs aside.
pub(super) fn plain(text: &str) -> String {
    let steers =
        |c: char| c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let shown = |c: char| if steers(c) && c != '\n' && c != '\t' { '\u{fffd}' } else { c };
    text.chars().map(shown).collect()
}

/// The folder that `path` lies in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}
