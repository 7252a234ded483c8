//! Hidden layers by rows: each thread has a neuron of every layer, and keeps its weights.
//!
//! Activations are `[trajectories, inputs / 4]` vectors of 4 inputs, in two buffers that take turns.
//! Twin: backend/cpu/mlp.rs.

use super::network::Fused;
use super::shape::masked;

/// The parts of a vector.
const PARTS: [&str; 4] = ["x", "y", "z", "w"];

/// The buffer that layer `number` reads.
pub(super) fn buffer(number: usize) -> &'static str {
    ["even", "odd"][number % 2]
}

/// `put_inputs`, `begin_drive` and `run_hidden`.
pub(super) fn text(fused: &Fused) -> String {
    let begin = begin(fused);
    let mut text = sizes(fused) + &kept(fused) + &inputs(fused);
    text += &format!("fn begin_drive(lane: u32) {{\n{begin}}}\nfn run_hidden(lane: u32) {{\n");
    for number in 0..fused.hidden().len() {
        text += &layer(fused, number);
    }
    text + "}\n"
}

/// Sizes and workgroup memory.
fn sizes(fused: &Fused) -> String {
    let quads = fused.layers.iter().map(|layer| layer.depth / 4).max().unwrap_or(1);
    let vectors = quads * fused.trajectories();
    format!(
        "const INPUT_QUADS: u32 = {quads}u;\nvar<workgroup> even: array<vec4<f32>, {vectors}>;\n\
         var<workgroup> odd: array<vec4<f32>, {vectors}>;\n"
    )
}

/// The weights that a thread keeps: vectors of 4 inputs, and the bias, of its neuron in each layer.
fn kept(fused: &Fused) -> String {
    let mut text = String::new();
    for (number, layer) in fused.hidden().iter().enumerate() {
        text += &format!("var<private> bias_{number}: f32;\n");
        for quad in 0..layer.depth / 4 {
            text += &format!("var<private> row_{number}_{quad}: vec4<f32>;\n");
        }
    }
    text
}

/// Loads them.
fn begin(fused: &Fused) -> String {
    let mut text = String::new();
    for (number, layer) in fused.hidden().iter().enumerate() {
        // Threads beyond the layer keep its last neuron and write nothing.
        text += &format!("    let n_{number} = min(lane, {}u);\n", 4 * layer.quads - 1);
        let part = format!("[n_{number} % 4u]");
        let at = |row: u32| {
            let base = layer.offset + (row + 1) * layer.quads;
            format!("weights[{base}u + n_{number} / 4u]{part}")
        };
        let bias = format!("weights[{}u + n_{number} / 4u]{part}", layer.offset);
        text += &format!("    bias_{number} = {bias};\n");
        for quad in 0..layer.depth / 4 {
            let all = [0, 1, 2, 3].map(|i| at(4 * quad + i)).join(", ");
            text += &format!("    row_{number}_{quad} = vec4<f32>({all});\n");
        }
    }
    text
}

/// `put_inputs`: what the network sees of a trajectory, with 0 behind it.
fn inputs(fused: &Fused) -> String {
    let mut text = String::from("fn put_inputs(lane: u32, seen: array<f32, SEEN>) {\n");
    for quad in 0..fused.layers[0].depth / 4 {
        let entry = |i: u32| match 4 * quad + i {
            row if row < fused.inputs() => format!("seen[{row}]"),
            _ => "0.0".to_owned(),
        };
        let all = [0, 1, 2, 3].map(entry).join(", ");
        let place = format!("lane * INPUT_QUADS + {quad}u");
        text += &format!("    {}[{place}] = vec4<f32>({all});\n", buffer(0));
    }
    text + "}\n"
}

/// One layer of all trajectories.
fn layer(fused: &Fused, number: usize) -> String {
    let layer = fused.hidden()[number];
    let (from, to) = (buffer(number), buffer(number + 1));
    let mut text = format!("    if lane < {}u {{\n", 4 * layer.quads);
    for c in 0..fused.trajectories() {
        text += &format!("        var s_{c} = bias_{number};\n");
    }
    for quad in 0..layer.depth / 4 {
        for c in 0..fused.trajectories() {
            text += &format!("        let h_{quad}_{c} = {from}[{c}u * INPUT_QUADS + {quad}u];\n");
        }
        // Neighbouring products belong to different sums: none waits for the one before.
        for (part, c) in
            PARTS.iter().flat_map(|part| (0..fused.trajectories()).map(move |c| (part, c)))
        {
            let factors = format!("row_{number}_{quad}.{part}, h_{quad}_{c}.{part}");
            text += &format!("        s_{c} = fma({factors}, s_{c});\n");
        }
    }
    for c in 0..fused.trajectories() {
        let padded = layer.neurons != 4 * layer.quads;
        let neurons = format!("{}u", layer.neurons);
        let activated = match fused.hidden_activations() {
            [_] => format!("hidden_activation(s_{c})"),
            _ => format!("hidden_activation_{}(s_{c})", layer.activation),
        };
        let value = masked(&activated, "lane", &neurons, padded);
        // As in the tiles, neighbours write the parts of a vector.
        let place = format!("{to}[{c}u * INPUT_QUADS + lane / 4u][lane % 4u]");
        text += &format!("        {place} = {value};\n");
    }
    text + "    }\n    workgroupBarrier();\n"
}
