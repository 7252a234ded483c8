//! The command `init`: a starting configuration with comments, in a file of one's own.

mod templates;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::options::{Global, Own, Replace};
use super::{Outcome, document, folder_of, report};
use crate::error::{Error, Result};
use crate::files::Staged;
use crate::formula::text::nearest;
use templates::{TEMPLATES, Template};

/// What `init` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct InitArguments {
    /// File to write
    #[arg(default_value = "plant.toml")]
    file: PathBuf,
    /// The plant to start from
    #[arg(long, value_name = "NAME", default_value = "cart-pole")]
    from: String,
    #[command(flatten)]
    replace: Replace,
}

impl InitArguments {
    /// The options that not every command has.
    pub(super) fn own(&self) -> Own {
        Own { replace: self.replace, ..Own::default() }
    }
}

/// What `init --json` prints.
#[derive(Serialize)]
struct Written {
    from: &'static str,
    files: Vec<PathBuf>,
}

/// Writes the configuration, and the networks that it names beside it.
pub(super) fn run(global: &Global, asked: &InitArguments) -> Result<Outcome> {
    let template = named(&asked.from)?;
    let name = asked.file.file_name().and_then(|name| name.to_str());
    let name = name.filter(|name| name.ends_with(".toml")).ok_or_else(|| {
        let problem = format!("`{}` is no name of a .toml file", asked.file.display());
        Error::invalid("FILE", problem)
    })?;
    let mut staged = Staged::new(folder_of(&asked.file))?;
    for copy in template.files {
        staged.add(copy.name, copy.bytes)?;
    }
    staged.add(name, template.text(&asked.file).as_bytes())?;
    let files = staged.publish_sparing(global.existing)?;
    let written = Written { from: template.name, files };
    report(global, &document(&written), || words(template, &asked.file, &written))?;
    Ok(Outcome::Done)
}

/// The template `name`.
fn named(name: &str) -> Result<&'static Template> {
    let found = TEMPLATES.iter().find(|template| template.name == name);
    found.ok_or_else(|| {
        let names: Vec<&str> = TEMPLATES.iter().map(|template| template.name).collect();
        let near = nearest(name, names.iter().copied());
        let near = near.map_or_else(String::new, |near| format!("; the nearest is `{near}`"));
        let problem = format!("`{name}` is unknown{near}; there are {}", names.join(", "));
        Error::invalid("--from", problem)
    })
}

/// What was written, and what to do with it.
fn words(template: &Template, file: &Path, written: &Written) -> String {
    let files: Vec<String> = written.files.iter().map(|file| file.display().to_string()).collect();
    format!("{}: {}\n\nnext:\n{}", files.join(", "), template.about, template.commands(file))
}

/// The names of the templates, for the help.
pub(super) fn names() -> String {
    let line = |template: &Template| format!("  {:<18} {}\n", template.name, template.about);
    TEMPLATES.iter().map(line).collect()
}
