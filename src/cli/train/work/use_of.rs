//! How a policy that was trained for a model as text is used: the section that names its file.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use crate::config::Config;
use crate::error::{Error, Result};
use crate::train::settings::Method;

/// Name of the file of a policy.
const FILE: &str = "policy.safetensors";

/// The section `policy` with the file beside it, where a policy of a model as text was trained.
pub(super) fn section(config: &Config) -> Result<Option<String>> {
    naming(config, FILE)
}

/// The last words of the command: the section as it stands in the configuration of `folder` where the
/// results are in `out`; nothing where no policy of a model as text was trained.
pub(super) fn words(config: &Config, folder: &Path, out: &Path) -> Result<String> {
    let file = beside(folder, &out.join(FILE))?.display().to_string();
    let lines = naming(config, &file)?;
    let words =
        |lines| format!("to use the policy, give the configuration this section:\n\n{lines}");
    Ok(lines.map_or_else(String::new, words))
}

/// The section `policy` with that file.
fn naming(config: &Config, file: &str) -> Result<Option<String>> {
    if matches!(config.train_settings()?.method, Method::Value | Method::ActionValue) {
        return Ok(None);
    }
    let Some(section) = config.trained_policy(file)? else { return Ok(None) };
    let refused = |e: toml::ser::Error| Error::invalid("policy", e.to_string());
    let table = Table::try_from(section).map_err(refused)?;
    let document = Table::from_iter([("policy".to_owned(), Value::Table(table))]);
    toml::to_string(&document).map(Some).map_err(refused)
}

/// `file` as a configuration in `folder` names it.
fn beside(folder: &Path, file: &Path) -> Result<PathBuf> {
    match folder.as_os_str().is_empty() || folder == Path::new(".") {
        true => Ok(file.to_owned()),
        false => std::path::absolute(file).map_err(|e| Error::file(file, e)),
    }
}
