//! A [`Tape`] as an operation on tensors: a row of a batch is one evaluation.

use std::sync::Arc;

use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::NoCheckpointing;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_tensor::backend::Backend;
use burn_tensor::{Tensor, TensorData, TensorPrimitive};

use super::network::{Device, Differentiable, Plain};
use super::tape::Tape;
use crate::real::Lanes;

/// Rows that go through a tape side by side.
const WIDTH: usize = 16;

/// The outputs `[rows, outputs]` of `tape` for inputs that stand side by side, `[rows, columns]`
/// each, with derivatives.
///
/// One operation for the whole graph: node by node, each of a few thousand small tensors would
/// cost more to book than to compute.
///
/// # Panics
/// If the columns are not the tape's inputs, or the tensors have not the same rows.
pub fn apply<const N: usize>(
    tape: &Arc<Tape>,
    temperature: f32,
    inputs: [Tensor<Differentiable, 2>; N],
) -> Tensor<Differentiable, 2> {
    let rows = inputs[0].dims()[0];
    assert!(inputs.iter().all(|input| input.dims()[0] == rows), "rows of the inputs");
    let nodes = inputs.each_ref().map(|input| input.clone().into_primitive().tensor().node);
    let state = Swept {
        tape: tape.clone(),
        temperature,
        inputs: Batch::new(rows, inputs.map(Tensor::inner)).into(),
    };
    let outputs = tensor::<Plain>(state.forward(), [rows, tape.outputs()]);
    let outputs = outputs.into_primitive().tensor();
    let sweep = Backward::<Plain, N>::prepare::<NoCheckpointing>(Sweep, nodes);
    let outputs = match sweep.compute_bound().stateful() {
        OpsKind::Tracked(prep) => prep.finish(state, outputs),
        OpsKind::UnTracked(prep) => prep.finish(outputs),
    };
    Tensor::from_primitive(TensorPrimitive::Float(outputs))
}

/// The reverse sweep of a tape over a batch.
#[derive(Debug)]
struct Sweep;

/// What it needs of the forward sweep; values are computed again, which is cheaper than keeping
/// those of all steps.
#[derive(Clone, Debug)]
struct Swept {
    tape: Arc<Tape>,
    temperature: f32,
    inputs: Arc<Batch>,
}

impl<const N: usize> Backward<Plain, N> for Sweep {
    type State = Swept;

    fn backward(self, ops: Ops<Swept, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let seeds = grads.consume::<Plain>(&ops.node);
        let seeds = floats::<2>(Tensor::from_primitive(TensorPrimitive::Float(seeds)));
        let slopes = ops.state.backward(&seeds);
        let rows = ops.state.inputs.rows;
        for (parent, (slopes, columns)) in ops.parents.into_iter().zip(slopes) {
            if let Some(parent) = parent {
                let slopes = tensor::<Plain>(slopes, [rows, columns]).into_primitive().tensor();
                grads.register::<Plain>(parent.id, slopes);
            }
        }
    }
}

impl Swept {
    /// The outputs, row by row.
    fn forward(&self) -> Vec<f32> {
        let outputs = self.tape.outputs();
        let mut found = vec![0.0; self.inputs.rows * outputs];
        let (mut lanes, mut values) = (Vec::new(), Vec::new());
        for (tile, found) in found.chunks_mut(WIDTH * outputs).enumerate() {
            self.inputs.load(tile, &mut lanes);
            self.tape.forward(&lanes, self.temperature, &mut values);
            store(self.tape.read(&values), found, outputs);
        }
        found
    }

    /// The derivatives by each of the inputs, row by row, with their columns.
    fn backward(&self, seeds: &[f32]) -> Vec<(Vec<f32>, usize)> {
        let (tape, inputs) = (&self.tape, &self.inputs);
        let seeds = Batch { rows: inputs.rows, parts: vec![(seeds.to_vec(), tape.outputs())] };
        let empty = |(_, columns): &(Vec<f32>, usize)| (vec![0.0; inputs.rows * columns], *columns);
        let mut slopes: Vec<_> = inputs.parts.iter().map(empty).collect();
        let (mut lanes, mut seeded) = (Vec::new(), Vec::new());
        let (mut values, mut adjoints) = (Vec::new(), Vec::new());
        let mut found = vec![Lanes([0.0; WIDTH]); tape.inputs()];
        for tile in 0..inputs.rows.div_ceil(WIDTH) {
            inputs.load(tile, &mut lanes);
            seeds.load(tile, &mut seeded);
            tape.forward(&lanes, self.temperature, &mut values);
            tape.backward(&values, &seeded, self.temperature, &mut adjoints, &mut found);
            let mut rest = found.iter().copied();
            for (slopes, columns) in &mut slopes {
                let size = WIDTH * *columns;
                let end = slopes.len().min((tile + 1) * size);
                store(rest.by_ref().take(*columns), &mut slopes[tile * size..end], *columns);
            }
        }
        slopes
    }
}

/// Numbers side by side: `[rows, columns]` of each part, with its columns.
#[derive(Clone, Debug)]
struct Batch {
    rows: usize,
    parts: Vec<(Vec<f32>, usize)>,
}

impl Batch {
    fn new<const N: usize>(rows: usize, parts: [Tensor<Plain, 2>; N]) -> Self {
        let part = |part: Tensor<Plain, 2>| {
            let columns = part.dims()[1];
            (floats(part), columns)
        };
        Self { rows, parts: parts.map(part).into() }
    }

    /// The rows of tile number `tile` as columns of lanes; lanes without a row hold zeros.
    fn load(&self, tile: usize, lanes: &mut Vec<Lanes<WIDTH>>) {
        lanes.clear();
        for (values, columns) in &self.parts {
            let first = lanes.len();
            lanes.resize(first + columns, Lanes([0.0; WIDTH]));
            let rows = values.chunks_exact(*columns).skip(tile * WIDTH).take(WIDTH);
            for (lane, row) in rows.enumerate() {
                for (lanes, value) in lanes[first..].iter_mut().zip(row) {
                    lanes.0[lane] = *value;
                }
            }
        }
    }
}

/// Columns of lanes as rows.
fn store(lanes: impl Iterator<Item = Lanes<WIDTH>>, rows: &mut [f32], columns: usize) {
    for (i, lanes) in lanes.enumerate() {
        for (row, value) in rows.chunks_exact_mut(columns).zip(lanes.0) {
            row[i] = value;
        }
    }
}

/// A tensor from its numbers, row by row.
pub(super) fn tensor<B: Backend<Device = Device>>(
    values: Vec<f32>,
    shape: [usize; 2],
) -> Tensor<B, 2> {
    Tensor::from_data(TensorData::new(values, shape), &Device::Cpu)
}

/// The numbers of a tensor, row by row.
///
/// # Panics
/// If they are not f32, which no tensor here is.
pub(super) fn floats<const D: usize>(tensor: Tensor<Plain, D>) -> Vec<f32> {
    tensor.into_data().into_vec().expect("tensors are of f32")
}
