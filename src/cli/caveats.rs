//! What a plant leaves out or is easily forgotten of it, said before the work.

use std::io::Write;

use super::options::Global;
use super::output::plain;
use crate::config::Config;
use crate::model::{Law, Plant};
use crate::policy::Activation;

/// Says on standard error what is to be known of `plant`, which `config` describes.
pub(super) fn say(global: &Global, config: &Config, plant: &Plant) {
    tell(global, undisturbed(config).into_iter().chain(unscaled(plant)));
}

/// Says each of `notes` on standard error.
pub(super) fn tell(global: &Global, notes: impl Iterator<Item = String>) {
    for note in notes.filter(|_| !global.common.quiet) {
        // Whatever becomes of standard error, the work is done.
        let _ = writeln!(std::io::stderr(), "note: {}", plain(&note));
    }
}

/// That disturbances do nothing.
pub(super) fn undisturbed(config: &Config) -> Option<String> {
    let names = config.disturbances();
    (!names.is_empty()).then(|| {
        format!("{} disturbs nothing here: disturbances are 0 but in training", names.join(", "))
    })
}

/// That a network reaches a part of the controls alone, where nothing stands between.
fn unscaled(plant: &Plant) -> Option<String> {
    let Law::Network { network, act: None, .. } = &plant.controller.law else { return None };
    let beyond = plant.model.controls.iter().find(|axis| axis.low < -1.0 || axis.high > 1.0)?;
    let bounded = network.output() == Activation::Tanh && network.output_map().is_none();
    bounded.then(|| {
        format!(
            "the network says numbers from -1 to 1, and `{}` goes from {} to {}: `act` below `[policy]` scales \
             them, `{} = \"{} + {} * out[0]\"` for one; without it the rest is never used",
            beyond.name,
            beyond.low,
            beyond.high,
            beyond.name,
            0.5 * (beyond.low + beyond.high),
            0.5 * (beyond.high - beyond.low)
        )
    })
}
