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
use super::layers::recorded_activation;
use crate::policy::Activation;

/// `drive` by a network that the rollout runs itself, and `begin_drive`, which every thread calls once
/// before.
pub(super) fn fused_text(fused: &Fused, outputs: usize) -> String {
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
    [activations(fused), weights.to_owned(), layers, outputs, DRIVE.to_owned()].join("\n")
}

/// `hidden_activation` and `output_activation`. Where hidden layers differ, the first is told which, and each has one
/// by its number besides.
fn activations(fused: &Fused) -> String {
    let output = recorded_activation("output_activation", fused.output());
    let hidden = match fused.hidden_activations() {
        [] => recorded_activation("hidden_activation", Activation::Identity),
        [shared] => recorded_activation("hidden_activation", *shared),
        several => {
            let name = |number: usize| format!("hidden_activation_{number}");
            let each = several.iter().enumerate();
            let each = each.map(|(number, one)| recorded_activation(&name(number), *one));
            let mut text = each.collect::<Vec<_>>().join("\n");
            text += "\nfn hidden_activation(number: u32, x: f32) -> f32 {\n    switch number {\n";
            for number in 1..several.len() {
                text += &format!("        case {number}u: {{ return {}(x); }}\n", name(number));
            }
            text + &format!("        default: {{ return {}(x); }}\n    }}\n}}\n", name(0))
        }
    };
    [hidden, output].join("\n")
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
