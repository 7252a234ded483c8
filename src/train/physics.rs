//! A [`Tape`] as an operation on tensors: a row of a batch is one evaluation.

use std::sync::Arc;

use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::NoCheckpointing;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_backend::{Backend, TensorMetadata};
use burn_dispatch::{DispatchKindConversion, DispatchTensor};
use burn_tensor::Tensor;

use super::device::{Host, parts, primitive, values};
#[cfg(feature = "train-gpu")]
use super::device::{Remote, on_host};
use super::rows::{WIDTH, columns, store};
use super::tape::Tape;
use crate::real::Lanes;

/// The outputs `[rows, outputs]` of `tape` for inputs that stand side by side, `[rows, columns]`
/// each, with derivatives, on their device.
///
/// One operation for the whole graph: node by node, each of a few thousand small tensors would
/// cost more to book than to compute. It runs in lanes of the processor wherever the tensors are:
/// what crosses to an adapter and back is a few numbers per row.
///
/// # Panics
/// If the columns are not the tape's inputs, or the tensors have not the same rows.
pub fn apply<const N: usize>(
    tape: &Arc<Tape>,
    temperature: f32,
    inputs: [Tensor<2>; N],
) -> Tensor<2> {
    let rows = inputs[0].dims()[0];
    assert!(inputs.iter().all(|input| input.dims()[0] == rows), "rows of the inputs");
    #[cfg(feature = "train-gpu")]
    if !on_host(&inputs[0]) {
        return swept::<Remote, N>(tape, temperature, inputs);
    }
    swept::<Host, N>(tape, temperature, inputs)
}

/// The same for tensors of the backend `B`.
fn swept<B: Backend, const N: usize>(
    tape: &Arc<Tape>,
    temperature: f32,
    inputs: [Tensor<2>; N],
) -> Tensor<2>
where
    DispatchTensor: DispatchKindConversion<Autodiff<B>>,
{
    let [rows, _] = inputs[0].dims();
    let (inputs, nodes): (Vec<_>, Vec<_>) = inputs.map(parts::<B>).into_iter().unzip();
    let device = inputs[0].device();
    let state =
        Swept { tape: tape.clone(), temperature, inputs: Batch::new::<B>(rows, inputs).into() };
    let outputs = primitive::<B>(state.forward(), [rows, tape.outputs()], &device);
    let nodes = nodes.try_into().expect("one for each input");
    let sweep = Backward::<B, N>::prepare::<NoCheckpointing>(Sweep, nodes);
    let outputs = match sweep.compute_bound().stateful() {
        OpsKind::Tracked(prep) => prep.finish(state, outputs),
        OpsKind::UnTracked(prep) => prep.finish(outputs),
    };
    Tensor::from_primitive::<Autodiff<B>>(outputs)
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

impl<B: Backend, const N: usize> Backward<B, N> for Sweep {
    type State = Swept;

    fn backward(self, ops: Ops<Swept, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let seeds = grads.consume::<B>(&ops.node);
        let device = seeds.device();
        let slopes = ops.state.backward(values::<B>(seeds));
        let rows = ops.state.inputs.rows;
        for (parent, (slopes, columns)) in ops.parents.into_iter().zip(slopes) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, primitive::<B>(slopes, [rows, columns], &device));
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
    fn backward(&self, seeds: Vec<f32>) -> Vec<(Vec<f32>, usize)> {
        let (tape, inputs) = (&self.tape, &self.inputs);
        let seeds = Batch { rows: inputs.rows, parts: vec![(seeds, tape.outputs())] };
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
    /// The numbers of tensors of `rows` rows.
    fn new<B: Backend>(rows: usize, parts: Vec<B::FloatTensorPrimitive>) -> Self {
        let part = |part: B::FloatTensorPrimitive| {
            let [_, columns] = part.shape().dims();
            (values::<B>(part), columns)
        };
        Self { rows, parts: parts.into_iter().map(part).collect() }
    }

    /// The rows of tile number `tile` as columns of lanes; lanes without a row hold zeros.
    fn load(&self, tile: usize, lanes: &mut Vec<Lanes<WIDTH>>) {
        lanes.clear();
        self.parts.iter().for_each(|(values, count)| lanes.extend(columns(values, *count, tile)));
    }
}
