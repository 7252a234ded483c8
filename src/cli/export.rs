//! The command `policy export`: a policy as a file for other programs.

use safetensors::SafeTensors;
use serde::Serialize;
use serde_json::json;

use super::args::ExportArguments;
use super::options::Global;
use super::values::Target;
use super::{Outcome, document, folder_of, report};
use crate::error::{Error, Result};
use crate::files::{Array, Data, Inputs, Staged, npz_bytes};
use crate::policy::{Mlp, onnx_bytes};

/// What `policy export --json` prints.
#[derive(Serialize)]
struct Export {
    policy: String,
    out: String,
    to: Target,
    digest: String,
}

/// Writes a policy file as one for other programs.
pub(super) fn run(global: &Global, asked: &ExportArguments) -> Result<Outcome> {
    let missing = || Error::invalid("--out", "missing; name the file to write");
    let out = asked.out.as_deref().ok_or_else(missing)?;
    let name = out.file_name().and_then(|name| name.to_str());
    let ending = asked.to.ending();
    let name =
        name.filter(|_| out.extension().is_some_and(|own| own == ending)).ok_or_else(|| {
            Error::invalid("--out", format!("{}: the name has to end in .{ending}", out.display()))
        })?;
    Inputs::new([asked.file.clone()]).spare_file(out)?;
    let network = Mlp::load(&asked.file)?;
    let bytes = match asked.to {
        Target::Onnx => onnx_bytes(&network),
        Target::Npz => npz_bytes(&borrowed(&arrays(&network)?))?,
    };
    let mut staged = Staged::new(folder_of(out))?;
    staged.add(name, &bytes)?;
    staged.publish_sparing(global.existing)?;
    let export = Export {
        policy: asked.file.display().to_string(),
        out: out.display().to_string(),
        to: asked.to,
        digest: network.digest(),
    };
    let text = || format!("{}: {} of {}\n", export.out, ending, export.policy);
    report(global, &document(&export), text)?;
    Ok(Outcome::Done)
}

/// The arrays of a policy under the names of its file, and what else the file says as JSON in `metadata`.
fn arrays(network: &Mlp) -> Result<Vec<(String, Array)>> {
    let bytes = network.to_bytes();
    let own = |e: safetensors::SafeTensorError| Error::invalid("policy", e.to_string());
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(own)?;
    let file = SafeTensors::deserialize(&bytes).map_err(own)?;
    let mut arrays: Vec<(String, Array)> = file
        .iter()
        .map(|(name, view)| {
            let (words, _) = view.data().as_chunks::<4>();
            let data = Data::F32(words.iter().map(|&word| f32::from_le_bytes(word)).collect());
            (name.to_owned(), Array { shape: view.shape().to_vec(), data })
        })
        .collect();
    arrays.sort_by(|(a, _), (b, _)| a.cmp(b));
    let metadata: std::collections::BTreeMap<&String, &String> =
        header.metadata().iter().flatten().collect();
    let text = json!(metadata).to_string().into_bytes();
    arrays.push(("metadata".to_owned(), Array { shape: vec![text.len()], data: Data::U8(text) }));
    Ok(arrays)
}

/// The arrays with borrowed names.
fn borrowed(arrays: &[(String, Array)]) -> Vec<(&str, Array)> {
    arrays.iter().map(|(name, array)| (name.as_str(), array.clone())).collect()
}
