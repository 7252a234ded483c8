//! The command `policy eval`: what a policy gives for inputs from a file.

use rayon::prelude::*;
use serde::Serialize;

use super::args::EvalArguments;
use super::options::Global;
use super::{Outcome, document, folder_of, report};
use crate::error::{Error, Result};
use crate::files::{Array, Data, Inputs, Staged, npy_array, npy_array_bytes};
use crate::policy::Mlp;

/// Ending of files of one array.
const ENDING: &str = "npy";

/// What `policy eval --json` prints.
#[derive(Serialize)]
struct Eval {
    policy: String,
    inputs: String,
    outputs: String,
    /// Inputs that were evaluated.
    count: usize,
    /// Outputs of which a number is not finite.
    not_finite: usize,
    digest: String,
}

/// Evaluates a policy file, input by input, in f32.
pub(super) fn run(global: &Global, asked: &EvalArguments) -> Result<Outcome> {
    let name = asked.outputs.file_name().and_then(|name| name.to_str());
    let name = name.filter(|_| asked.outputs.extension().is_some_and(|ending| ending == ENDING));
    let name = name.ok_or_else(|| {
        let problem = format!("{}: the name has to end in .{ENDING}", asked.outputs.display());
        Error::invalid("--outputs", problem)
    })?;
    Inputs::new([asked.file.clone(), asked.inputs.clone()]).spare_file(&asked.outputs)?;
    let network = Mlp::load(&asked.file)?;
    let at = |problem| Error::file(&asked.inputs, problem);
    let array = npy_array(&asked.inputs)?;
    let Array { shape, data } = evaluate(&network, &array).map_err(at)?;
    let width = shape.last().copied().unwrap_or(1);
    let eval = Eval {
        policy: asked.file.display().to_string(),
        inputs: asked.inputs.display().to_string(),
        outputs: asked.outputs.display().to_string(),
        count: data.len() / width,
        not_finite: not_finite(&data, width),
        digest: network.digest(),
    };
    let mut staged = Staged::new(folder_of(&asked.outputs))?;
    staged.add(name, &npy_array_bytes(&Array { shape, data }))?;
    staged.publish_sparing(global.existing)?;
    report(global, &document(&eval), || text(&eval))?;
    Ok(Outcome::Done)
}

/// The outputs for `inputs`, `[N, inputs]` or `[inputs]`, in the shape of these.
fn evaluate(network: &Mlp, inputs: &Array) -> std::result::Result<Array, String> {
    let widths = network.widths();
    let (takes, gives) = (widths[0], widths[widths.len() - 1]);
    let mut shape = inputs.shape.clone();
    match shape.last_mut() {
        Some(width) if *width == takes && inputs.shape.len() <= 2 => *width = gives,
        _ => {
            let shape = &inputs.shape;
            return Err(format!(
                "shape {shape:?}; expected [N, {takes}] or [{takes}], as the policy takes {takes} numbers"
            ));
        }
    }
    let numbers = match &inputs.data {
        Data::F32(numbers) => numbers.clone(),
        Data::F64(numbers) => numbers.iter().map(|&number| number as f32).collect(),
        _ => {
            return Err("integers; expected f32 or f64: numpy.ascontiguousarray(x, dtype=\"<f4\")"
                .to_owned());
        }
    };
    let outputs = numbers.par_chunks_exact(takes).flat_map_iter(|input| network.forward(input));
    Ok(Array { shape, data: Data::F32(outputs.collect()) })
}

/// How many outputs have a number that is not finite.
fn not_finite(outputs: &Data, width: usize) -> usize {
    let rows = outputs.as_f32().unwrap_or_default().chunks_exact(width);
    rows.filter(|row| !row.iter().all(|number| number.is_finite())).count()
}

/// What was evaluated, in words.
fn text(eval: &Eval) -> String {
    let Eval { policy, inputs, outputs, count, not_finite, .. } = eval;
    let bad = match not_finite {
        0 => String::new(),
        bad => format!("note: {bad} of them have a number that is not finite\n"),
    };
    format!("{outputs}: {count} outputs of {policy} for {inputs}\n{bad}")
}
