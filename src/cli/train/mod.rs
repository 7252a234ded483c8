//! The command `train`: a policy or a value network, trained, stored and reported.

#[cfg(feature = "train")]
mod work;

use std::path::Path;

use super::args::Global;
use super::{Outcome, folder_of};
use crate::config::Config;
use crate::error::Result;
use crate::train::settings::Method;

/// Trains what the configuration asks for.
pub(super) fn run(global: &Global, config: &Path, method: Option<Method>) -> Result<Outcome> {
    let folder = folder_of(config);
    let mut config = Config::load(config, &global.overrides())?;
    if let (Some(method), Some(train)) = (method, &mut config.train) {
        train.method = method;
    }
    config.train_settings()?;
    #[cfg(feature = "train")]
    return work::run(global, &config, folder);
    #[cfg(not(feature = "train"))]
    refused(folder)
}

/// The answer of a program without tensors.
#[cfg(not(feature = "train"))]
fn refused(_: &Path) -> Result<Outcome> {
    let problem = "this program was built without training; build it with `cargo build --release \
                   --features train`, or with `--features train-gpu` to train on a GPU too";
    Err(crate::error::Error::invalid("train", problem))
}
