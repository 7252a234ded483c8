//! Networks that rollouts run themselves: how the threads of a workgroup share them, and the text.
//!
//! Every sum is one chain of `fma` from the bias over ascending inputs, padded to whole blocks, in every
//! form: a trajectory has the same bits whatever the form, the batch and its place in it.

mod form;
mod last;
mod network;
mod rows;
mod shape;
mod tiles;

pub use form::Form;
pub use network::Fused;
pub(in crate::backend::gpu) use shape::packed;

use super::glue::component;
use super::layers::{Activations, recorded_activations};

/// `drive` by a network that the rollout runs itself, and `begin_drive`, which every thread calls once
/// before.
pub(super) fn fused_text(activations: Activations, fused: &Fused, outputs: usize) -> String {
    let layers = match fused.form() {
        Form::Tiles { .. } | Form::Slices { .. } => tiles::text(fused),
        Form::Rows { .. } => rows::text(fused),
    };
    let all: Vec<String> = (0..outputs).map(component).collect();
    let outputs = format!(
        "fn outputs_at(lane: u32) -> array<f32, SAID> {{\n{}    return array<f32, SAID>({});\n}}\n",
        last::text(fused),
        all.join(", ")
    );
    let weights = "@group(0) @binding(14) var<storage, read> weights: array<vec4<f32>>;\n";
    [recorded_activations(Some(activations)), weights.to_owned(), layers, outputs, DRIVE.to_owned()]
        .join("\n")
}

/// Who calls it calls it with all threads; threads from `COLUMNS` on only help.
const DRIVE: &str = "\
fn drive(lane: u32, column: u32, x: array<f32, NX>, t: u32) -> array<f32, NU> {
    // The outputs of the step before are read before they are replaced.
    workgroupBarrier();
    if lane < COLUMNS {
        put_inputs(lane, observed(x, t));
    }
    workgroupBarrier();
    run_hidden(lane);
    return acted(x, outputs_at(lane % COLUMNS), t);
}
";
