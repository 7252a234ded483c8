//! What `falsify` says in the end: its document, its files and its words.

use std::fmt::Write;
use std::path::PathBuf;

use serde::Serialize;

use super::document;
use crate::backend::Event;
use crate::error::Result;
use crate::files::{MANIFEST, Staged, json};
use crate::model::{Model, Plant};
use crate::report::{Search, falsify_html};
use crate::rollout::Region;
use crate::rounding::number;
use crate::scenario::counterexamples::{COUNTEREXAMPLES, REPLAYED, replayed_csv, starts_csv};
use crate::scenario::falsify::{Against, FalsifyRecord, FileRecord};
use crate::scenario::record::Provenance;
use crate::system::Axis;

/// Name of the record of a search.
const RECORD: &str = "falsify.json";
/// Name of its page.
const PAGE: &str = "report.html";

/// What `falsify --json` prints, and [`RECORD`] holds.
#[derive(Serialize)]
pub(super) struct Answer<'a> {
    #[serde(flatten)]
    record: &'a FalsifyRecord,
    /// Where was looked, in words.
    within: &'a str,
    /// What the search did not vary, in words.
    fixed: &'a [String],
    /// The certificate's claim about the same starts, beside the uniform draws of this search.
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<&'a Against>,
    /// The starts of the file that was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'a FileRecord>,
    backend: &'a str,
    device: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    networks: Option<&'a str>,
    events: &'a [Event],
}

/// What is printed and stored of a search.
pub(super) fn answer<'a>(found: &'a Search<'a>) -> Answer<'a> {
    let Provenance { backend, device, networks, .. } = &found.provenance;
    Answer {
        record: found.record,
        within: found.within,
        fixed: &found.fixed,
        against: found.against,
        file: found.file,
        backend,
        device,
        networks: networks.as_deref(),
        events: &found.events,
    }
}

/// What no search varies, in words: parameters, and coordinates that the region freezes.
pub(super) fn fixed(model: &Model, region: &Region) -> Vec<String> {
    let parameters: Vec<String> =
        model.parameters.iter().map(|one| format!("{} = {}", one.name, one.value)).collect();
    let varies = region.varies();
    let frozen = model.states.iter().zip(&varies).filter(|(_, varies)| !**varies);
    let frozen: Vec<&str> = frozen.map(|(axis, _)| axis.name.as_str()).collect();
    let parameters =
        (!parameters.is_empty()).then(|| format!("parameters {}", parameters.join(", ")));
    let frozen = (!frozen.is_empty()).then(|| format!("coordinates {}", frozen.join(", ")));
    parameters.into_iter().chain(frozen).collect()
}

/// Writes the files of the folder, the record last.
///
/// # Errors
/// Those of the files.
pub(super) fn stage(
    staged: &mut Staged,
    plant: &Plant,
    found: &Search<'_>,
    region: &Region,
    manifest: &str,
) -> Result<()> {
    let (model, record) = (&plant.model, found.record);
    staged.add(MANIFEST, manifest.as_bytes())?;
    if !record.starts.is_empty() {
        let table = starts_csv(&model.states, &model.parameters, &record.starts);
        staged.add(COUNTEREXAMPLES, table.as_bytes())?;
    }
    if !record.pairs.is_empty() {
        let axes: [&[Axis]; 2] = [&model.states, &model.controls];
        let table = replayed_csv(axes, &model.parameters, &record.pairs);
        staged.add(REPLAYED, table.as_bytes())?;
    }
    staged.add(PAGE, falsify_html(found, &model.states, region).as_bytes())?;
    staged.add(RECORD, json(RECORD, &document(&answer(found)))?.as_bytes())
}

/// What was found, or what was tried.
pub(super) fn text(plant: &Plant, found: &Search<'_>, files: &[PathBuf]) -> String {
    let Search { record, within, .. } = found;
    let mut text = match record.found {
        true => {
            format!("a start of {within} fails, on {} and in f64\n", found.provenance.device)
        }
        false => {
            format!("no failing start of {within} was found; that is no proof that there is none\n")
        }
    };
    let FalsifyRecord { rollouts, budget, uniform, uniform_failures, restarts, rounds, .. } =
        record;
    // A String takes whatever is written to it.
    let _ = writeln!(
        text,
        "tried: {rollouts} of {budget} rollouts in {rounds} batches; {uniform} uniform draws, of which \
         {uniform_failures} fail, and {restarts} clouds by cross-entropy and descent; seed {}",
        record.seed
    );
    if let Some(best) = &record.best {
        let names = plant.model.states.iter().map(|axis| axis.name.as_str());
        let at: Vec<String> = names.zip(&best.x).map(|(name, x)| format!("{name} {x}")).collect();
        let _ = writeln!(text, "smallest measure: {} at {}", number(best.measure), at.join(", "));
    }
    if record.unconfirmed > 0 {
        let _ = writeln!(text, "{} fail in f32 alone, and do not count", record.unconfirmed);
    }
    for words in &found.fixed {
        let _ = writeln!(text, "not varied: {words}");
    }
    let file = found.file.map(|file| &file.words);
    for words in found.against.map(|against| &against.words).into_iter().chain(file) {
        let _ = writeln!(text, "{words}");
    }
    for file in files {
        let _ = writeln!(text, "file: {}", file.display());
    }
    text
}
