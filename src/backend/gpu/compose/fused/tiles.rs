//! Hidden layers by tiles: each thread has some neurons of some trajectories.
//!
//! Activations are `[rows, trajectories / 4]` vectors of 4 trajectories, so that a tile of 8 by 8 needs
//! four loads for 64 products. Twin: backend/cpu/mlp.rs.

use super::form::Form;
use super::network::Fused;
use super::shape::{BLOCK, FusedLayer, masked, pads};

/// The parts of a vector.
const PARTS: [&str; 4] = ["x", "y", "z", "w"];

/// `put_inputs`, `begin_drive` and `run_hidden`.
pub(super) fn text(fused: &Fused) -> String {
    let several = fused.hidden_activations().len() > 1;
    let tile = Tile { form: fused.form(), loads: loads(fused), several };
    let staged = matches!(fused.form(), Form::Slices { .. });
    let mut text = sizes(fused) + &inputs(fused) + &layer_table(fused.hidden(), several);
    if staged {
        text += &slice_memory(fused);
    }
    let begin = if staged {
        load_ahead("layer_at(0u).offset + SLICE_QUADS", tile.loads)
    } else {
        String::new()
    };
    text += &format!("fn begin_drive(lane: u32) {{\n{begin}}}\n");
    text += "fn dense(layer: Layer, next: u32, lane: u32) {\n";
    text += &tile.places();
    text += &if staged { tile.slices() } else { tile.stored() };
    text += "    // All inputs are read before the first is replaced.\n    workgroupBarrier();\n";
    text += &tile.put(pads(fused.hidden()));
    text += "    workgroupBarrier();\n}\n";
    text + &format!(
        "fn run_hidden(lane: u32) {{\n    for (var i = 0u; i < {count}u; i += 1u) {{\n        \
         let next = layer_at(select(i + 1u, 0u, i + 1u == {count}u));\n        \
         dense(layer_at(i), next.offset + next.quads, lane);\n    }}\n}}\n",
        count = fused.hidden().len()
    )
}

/// Sizes and workgroup memory.
fn sizes(fused: &Fused) -> String {
    let trajectories = fused.trajectories();
    let rows = fused.layers.iter().map(|layer| layer.depth).max().unwrap_or(BLOCK);
    format!(
        "const COLUMN_QUADS: u32 = {}u;\nconst PITCH: u32 = {}u;\n\
         var<workgroup> activations: array<vec4<f32>, {}>;\n\
         struct Layer {{\n    // Of the biases, which [depth, quads] vectors of weights follow.\n    \
         offset: u32,\n    depth: u32,\n    quads: u32,\n    neurons: u32,\n{}}}\n",
        trajectories / 4,
        trajectories / fused.form().tile_columns(),
        rows * trajectories / 4,
        if fused.hidden_activations().len() > 1 { "    activation: u32,\n" } else { "" },
    )
}

/// `put_inputs`: what the network sees of a trajectory, rows of 0 behind it.
fn inputs(fused: &Fused) -> String {
    let depth = fused.layers[0].depth;
    let mut text = String::from("fn put_inputs(lane: u32, seen: array<f32, SEEN>) {\n");
    for row in 0..depth {
        let value = if row < fused.inputs() { format!("seen[{row}]") } else { "0.0".to_owned() };
        // Parts of a vector that lie side by side are written by different threads: each of the
        // translations of the text stores one number.
        text +=
            &format!("    activations[{row}u * COLUMN_QUADS + lane / 4u][lane % 4u] = {value};\n");
    }
    text + "}\n"
}

/// `layer_at`: the hidden layers by number.
fn layer_table(hidden: &[FusedLayer], several: bool) -> String {
    let mut text = String::from("fn layer_at(number: u32) -> Layer {\n    switch number {\n");
    for (number, layer) in hidden.iter().enumerate() {
        let FusedLayer { offset, depth, quads, neurons, activation } = layer;
        let activation = if several { format!(", {activation}u") } else { String::new() };
        let last = number + 1 == hidden.len();
        let case = if last { "default".to_owned() } else { format!("case {number}u") };
        let layer = format!("Layer({offset}u, {depth}u, {quads}u, {neurons}u{activation})");
        text += &format!("        {case}: {{ return {layer}; }}\n");
    }
    if hidden.is_empty() {
        text += "        default: { return Layer(0u, 0u, 0u, 0u); }\n";
    }
    text + "    }\n}\n"
}

/// Vectors of a slice that each thread loads.
fn loads(fused: &Fused) -> u32 {
    BLOCK * fused.layers[0].quads / fused.lanes().max(1)
}

/// Two slices of weights, and the vectors of the next one that a thread has loaded.
fn slice_memory(fused: &Fused) -> String {
    let quads = fused.layers[0].quads;
    let mut text = format!(
        "const SLICE_QUADS: u32 = {quads}u;\nconst SLICE: u32 = {}u;\n\
         var<workgroup> slots: array<vec4<f32>, {}>;\nvar<private> turn: u32 = 0u;\n",
        BLOCK * quads,
        2 * BLOCK * quads,
    );
    for j in 0..loads(fused) {
        text += &format!("var<private> ahead_{j}: vec4<f32>;\n");
    }
    text
}

/// Loads a thread's vectors of the slice at `from`.
fn load_ahead(from: &str, loads: u32) -> String {
    let mut text = format!("    let start = {from};\n");
    for j in 0..loads {
        text += &format!("    ahead_{j} = weights[start + {j}u * LANES + lane];\n");
    }
    text
}

/// The tile of a thread.
struct Tile {
    form: Form,
    /// Vectors of a slice that a thread loads.
    loads: u32,
    /// Whether layers say which activation is theirs.
    several: bool,
}

impl Tile {
    /// Vectors of 4 neurons.
    fn groups(&self) -> u32 {
        self.form.tile_neurons() / 4
    }

    /// Vectors of 4 trajectories.
    fn across(&self) -> u32 {
        self.form.tile_columns() / 4
    }

    /// Each sum: neuron and trajectory within the tile.
    fn sums(&self) -> impl Iterator<Item = (u32, u32)> {
        let columns = self.form.tile_columns();
        (0..self.form.tile_neurons()).flat_map(move |i| (0..columns).map(move |c| (i, c)))
    }

    /// Where the tile lies: neighbouring threads read neighbouring vectors.
    fn places(&self) -> String {
        format!(
            "    let across = lane % PITCH;\n    let down = lane / PITCH;\n    \
             let span = layer.quads / {}u;\n    let busy = down < span;\n",
            self.groups()
        )
    }

    /// The sums, at their biases.
    fn biases(&self) -> String {
        let mut text = String::new();
        for group in 0..self.groups() {
            let at = format!("layer.offset + {group}u * span + down");
            text += &format!("    let bias_{group} = weights[{at}];\n");
        }
        for (i, c) in self.sums() {
            let part = PARTS[i as usize % 4];
            text += &format!("    var a_{i}_{c} = bias_{}.{part};\n", i / 4);
        }
        text
    }

    /// The products of one input: weights at `at(group)`, activations of row `row`.
    fn products(&self, at: impl Fn(u32) -> String, row: &str) -> String {
        let mut text = String::new();
        for group in 0..self.groups() {
            text += &format!("        let w_{group} = {};\n", at(group));
        }
        for quad in 0..self.across() {
            let place = format!("{row} * COLUMN_QUADS + across + {quad}u * PITCH");
            text += &format!("        let x_{quad} = activations[{place}];\n");
        }
        for (i, c) in self.sums() {
            let (weight, input) = (PARTS[i as usize % 4], PARTS[c as usize % 4]);
            let factors = format!("w_{}.{weight}, x_{}.{input}", i / 4, c / 4);
            text += &format!("        a_{i}_{c} = fma({factors}, a_{i}_{c});\n");
        }
        text
    }

    /// The sums from weights in storage, a few inputs at a time: their loads are under way together.
    fn stored(&self) -> String {
        // Threads beyond the layer read its last tile and write nothing.
        let mut text = self.biases().replace("+ down", "+ min(down, span - 1u)");
        text += "    let first = layer.offset + layer.quads + min(down, span - 1u);\n    \
                 for (var from_k = 0u; from_k < layer.depth; from_k += 4u) {\n";
        for k in 0..4 {
            let row = format!("(from_k + {k}u)");
            let at = |group| format!("weights[first + {row} * layer.quads + {group}u * span]");
            text += &format!("        {{\n{}        }}\n", self.products(at, &row));
        }
        text + "    }\n"
    }

    /// The sums from slices, each of which is stored and the next one loaded before it is used.
    fn slices(&self) -> String {
        let mut text = self.biases();
        text += "    let first = layer.offset + layer.quads;\n    \
                 for (var from_k = 0u; from_k < layer.depth; from_k += 8u) {\n        \
                 let slot = turn * SLICE;\n        turn = 1u - turn;\n";
        for j in 0..self.loads {
            text += &format!("        slots[slot + {j}u * LANES + lane] = ahead_{j};\n");
        }
        text += "        // The other slot was read before the last barrier but one.\n        \
                 workgroupBarrier();\n";
        let further = "first + (from_k + 8u) * SLICE_QUADS";
        let from = format!("select(next, {further}, from_k + 8u < layer.depth)");
        text += &load_ahead(&from, self.loads);
        for k in 0..BLOCK {
            let at = |group| format!("slots[slot + {k}u * SLICE_QUADS + {group}u * span + down]");
            let block = self.products(at, &format!("(from_k + {k}u)"));
            text += &format!("        {{\n{block}        }}\n");
        }
        text + "    }\n"
    }

    /// The sums as activations of the next layer.
    fn put(&self, padded: bool) -> String {
        let mut text = String::from("    if busy {\n");
        for i in 0..self.form.tile_neurons() {
            let neuron = format!("4u * ({}u * span + down) + {}u", i / 4, i % 4);
            text += &format!("        let n_{i} = {neuron};\n");
            for quad in 0..self.across() {
                let which = if self.several { "layer.activation, " } else { "" };
                let sum = |j: u32| format!("hidden_activation({which}a_{i}_{})", 4 * quad + j);
                let value = |j| masked(&sum(j), &format!("n_{i}"), "layer.neurons", padded);
                let values = [0, 1, 2, 3].map(value).join(", ");
                let place = format!("n_{i} * COLUMN_QUADS + across + {quad}u * PITCH");
                text += &format!("        activations[{place}] = vec4<f32>({values});\n");
            }
        }
        text + "    }\n"
    }
}
