//! Networks that rollouts run themselves: how the threads of a workgroup share them, and the text.
//!
//! Every sum is one chain of `fma` from the bias over ascending inputs, padded to whole blocks, in every
//! form: a trajectory has the same bits whatever the form, the batch and its place in it.

mod form;
mod last;
mod rows;
mod shape;
mod tiles;

pub use form::Form;
use shape::FusedLayer;
pub(in crate::backend::gpu) use shape::packed;

use super::glue::component;
use super::kernels::WORKGROUP;
use super::layers::{Activations, recorded_activations};
use crate::policy::Mlp;

/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: u64 = 16;

/// The layers of a network that the rollouts run themselves, all steps in one dispatch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fused {
    layers: Vec<FusedLayer>,
    /// Numbers that the network sees.
    inputs: u32,
    form: Form,
}

impl Fused {
    /// All layers of `mlp`, shared as `form` says; none where the network has no such form.
    pub fn new(mlp: &Mlp, form: Form) -> Option<Self> {
        let layers = FusedLayer::of(mlp);
        let inputs = mlp.widths()[0] as u32;
        form.fits(&layers).then_some(Self { layers, inputs, form })
    }

    /// How the threads share them.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Trajectories of a workgroup.
    pub fn trajectories(&self) -> u32 {
        self.form.trajectories()
    }

    /// Threads of a workgroup.
    pub fn lanes(&self) -> u32 {
        self.form.lanes(self.hidden())
    }

    /// Workgroup memory that activations and weights take, bytes.
    pub fn workgroup_bytes(&self) -> u64 {
        VECTOR_BYTES * u64::from(self.form.vectors(&self.layers))
    }

    /// Loop iterations of a thread for one evaluation of the network.
    pub(in super::super) fn trips(&self) -> u64 {
        self.layers.iter().map(|layer| 1 + u64::from(layer.depth)).sum()
    }

    /// All layers but the last.
    fn hidden(&self) -> &[FusedLayer] {
        &self.layers[..self.layers.len() - 1]
    }

    /// Numbers that the network sees.
    fn inputs(&self) -> u32 {
        self.inputs
    }

    /// The last layer.
    fn last(&self) -> FusedLayer {
        self.layers[self.layers.len() - 1]
    }
}

/// `drive` by a network that the rollout runs itself, and `begin_drive`, which every thread calls once
/// before.
pub(super) fn fused_text(activations: Activations, fused: &Fused, outputs: usize) -> String {
    let layers = match fused.form {
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

/// `0 <= neuron < neurons`, or 0: weights of 0 do not keep a padded neuron at 0 where an input is
/// infinite.
fn masked(value: &str, neuron: &str, neurons: &str, padded: bool) -> String {
    if padded { format!("select(0.0, {value}, {neuron} < {neurons})") } else { value.to_owned() }
}

/// Whether a hidden layer has neurons that pad it.
fn pads(hidden: &[FusedLayer]) -> bool {
    hidden.iter().any(|layer| layer.neurons != 4 * layer.quads)
}

/// The least number of threads: one for each trajectory, and no less than the other kernels have.
fn whole(lanes: u32) -> u32 {
    lanes.max(1).next_multiple_of(WORKGROUP / 2)
}
