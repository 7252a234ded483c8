//! The command `train`: a policy or a value network, trained, stored and reported.

#[cfg(feature = "train")]
mod work;

use std::path::Path;

use super::options::Global;
use super::{Outcome, folder_of};
use crate::config::Config;
use crate::error::Result;
use crate::files::Inputs;
use crate::train::settings::Method;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-train";

/// Trains what the configuration asks for.
pub(super) fn run(global: &Global, path: &Path, method: Option<Method>) -> Result<Outcome> {
    let (folder, out) = (folder_of(path), global.folder(DEFAULT_OUT));
    let mut config = Config::load(path, &global.overrides())?;
    if let (Some(method), Some(train)) = (method, &mut config.train) {
        train.method = method;
    }
    config.train_settings()?;
    let policy = config.policy.file.as_ref().map(|file| folder.join(file));
    let read = std::iter::once(path.to_owned()).chain(policy);
    Inputs::new(read).spare_folder(&out)?;
    #[cfg(feature = "train")]
    return work::run(global, &config, folder, &out);
    #[cfg(not(feature = "train"))]
    refused()
}

/// The answer of a program without tensors.
#[cfg(not(feature = "train"))]
fn refused() -> Result<Outcome> {
    let problem = "this program was built without training; build it with `cargo build --release \
                   --features train`, or with `--features train-gpu` to train on a GPU too";
    Err(crate::error::Error::invalid("train", problem))
}
