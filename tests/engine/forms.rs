//! Networks that rollouts run themselves: every form gives the same bits, and a form that sums in another
//! order, loses a neuron or lets a padded one through is noticed.

use crate::models;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::adapter;
use reachcast::backend::Backend;
use reachcast::backend::gpu::{Form, Gpu, NetworkKernels};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::real::Real;
use reachcast::rollout::{NON_FINITE, RolloutSpec};
use reachcast::system::{Axis, System};

/// Small tiles: what the others are held against.
const SMALL_TILES: Form = Form::Tiles { trajectories: 8, neurons: 4, columns: 4 };
/// Tiles as large batches have them.
const TILES: Form = Form::Tiles { trajectories: 32, neurons: 8, columns: 8 };
/// Weights through workgroup memory.
const SLICES: Form = Form::Slices { trajectories: 32 };
/// Weights in registers.
const ROWS: Form = Form::Rows { trajectories: 8 };

/// Goes where the control says. The target is beyond 0 on the left: from the right a state that is no
/// number comes before it is reached, and fails.
struct Line;

impl System<1, 1> for Line {
    fn name(&self) -> &str {
        "line"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [x + u]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        -x
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1e6)
    }
}

/// A network whose first hidden layer is infinite from the state 4 on, and whose second is 0 then: what
/// pads it would be no number, and what pads the last layer sees it.
fn overflowing() -> Mlp {
    let layer = |weight: f32, inputs: usize, outputs: usize| {
        Layer::dense(vec![weight; inputs * outputs], vec![0.0; outputs])
    };
    let layers = vec![layer(1e38, 1, 65), layer(-1.0, 65, 65), layer(1.0, 65, 1)];
    Mlp::new(layers, Activation::Relu, Activation::Tanh).expect("a whole network")
}

/// Measures of starts under `network`, run in `form`.
fn measures(gpu: Gpu, form: Form, network: Mlp, starts: &[[f32; 1]]) -> (Gpu, Vec<f32>) {
    let backend = Backend::Gpu(gpu.with_networks(NetworkKernels::Form(form)));
    let spec = RolloutSpec::new(3, 1.0).expect("a horizon");
    let program = backend.prepare(&Plant::of(Line, network)).expect("the network has the form");
    let found = program.measures(starts, &spec).expect("the kernels run");
    drop(program);
    let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU above") };
    (gpu, found)
}

/// The bits of measures under a network whose neurons all matter, and under one that overflows.
fn bits(gpu: Gpu, form: Form) -> Vec<u32> {
    let starts: Vec<[f32; 1]> = (0..100).map(|i| [-1.0 + 0.02 * i as f32]).collect();
    let (gpu, mut all) = measures(gpu, form, models::network(&[1, 70, 67, 1]), &starts);
    let (_, overflown) = measures(gpu, form, overflowing(), &[[4.0], [0.0]]);
    all.extend(overflown);
    all.into_iter().map(f32::to_bits).collect()
}

#[test]
fn every_form_has_the_same_bits() {
    let Some(gpu) = adapter() else { return };
    let expected = bits(gpu, SMALL_TILES);
    assert!(
        !expected.contains(&NON_FINITE.to_bits()),
        "infinite inputs make no padded neuron a NaN"
    );
    for form in
        [TILES, SLICES, ROWS, Form::Slices { trajectories: 64 }, Form::Rows { trajectories: 1 }]
    {
        let Some(gpu) = adapter() else { return };
        assert_eq!(bits(gpu, form), expected, "{form:?}");
    }
}

#[test]
fn forms_that_do_not_divide_a_workgroup_are_refused() {
    let tiles = |trajectories| Form::Tiles { trajectories, neurons: 4, columns: 4 };
    for form in
        [tiles(0), tiles(12), Form::Rows { trajectories: 3 }, Form::Slices { trajectories: 24 }]
    {
        let Some(gpu) = adapter() else { return };
        let backend = Backend::Gpu(gpu.with_networks(NetworkKernels::Form(form)));
        let refused = backend.prepare(&Plant::of(Line, overflowing())).map(drop);
        let problem = refused.expect_err("no whole workgroups").to_string();
        assert!(problem.contains("does not have the form"), "{problem}");
    }
}

/// Requires that the kernels of `form` have other bits once `change` has changed their text.
fn noticed(form: Form, change: impl Fn(&str) -> String + Send + Sync + 'static) {
    let (Some(whole), Some(gpu)) = (adapter(), adapter()) else { return };
    let changed = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&changed);
    let gpu = gpu.with_shader_edit(move |text| {
        let other = change(text);
        seen.fetch_or(other != text, Ordering::Relaxed);
        other
    });
    assert_ne!(bits(gpu, form), bits(whole, SMALL_TILES), "{form:?} changed and nothing noticed");
    assert!(changed.load(Ordering::Relaxed), "no kernel has what is changed");
}

/// Inputs of a slice in descending order.
fn descending(text: &str) -> String {
    let turned = |text: String, k: u32| {
        let other = 7 - k;
        text.replace(&format!("[slot + {k}u *"), &format!("[slot + #{other}u *")).replace(
            &format!("(from_k + {k}u) * COLUMN"),
            &format!("(from_k + #{other}u) * COLUMN"),
        )
    };
    (0..8).fold(text.to_owned(), turned).replace('#', "")
}

/// The second of 4 inputs before the first.
fn second_first(text: &str) -> String {
    let factors =
        |quad: u32, c: u32, part: &str| format!("row_1_{quad}.{part}, h_{quad}_{c}.{part}");
    let turned = |text: String, (quad, c): (u32, u32)| {
        let [first, second] = ["x", "y"].map(|part| factors(quad, c, part));
        text.replace(&first, "#").replace(&second, &first).replace('#', &second)
    };
    (0..18).flat_map(|quad| (0..8).map(move |c| (quad, c))).fold(text.to_owned(), turned)
}

/// Padded neurons as they come out.
fn unmasked(text: &str) -> String {
    let kept = text.replace("select(0.0, hidden_activation", "pick(0.0, hidden_activation");
    let pick = "fn pick(zero: f32, value: f32, real: bool) -> f32 {\n    return value;\n}\n";
    if kept == text { kept } else { [&kept, pick].join("\n") }
}

/// `text` with `new` for `old`.
fn with(old: &'static str, new: &'static str) -> impl Fn(&str) -> String + Send + Sync {
    move |text| text.replace(old, new)
}

macro_rules! noticed {
    ($($name:ident: $form:expr, $change:expr;)*) => {
        $(
            #[test]
            fn $name() {
                noticed($form, $change);
            }
        )*
    };
}

noticed! {
    tiles_in_descending_order: TILES, with(
        "for (var from_k = 0u; from_k < layer.depth; from_k += 4u) {\n",
        "for (var j = 0u; j < layer.depth; j += 4u) {\n        let from_k = layer.depth - 4u - j;\n",
    );
    slices_in_descending_order: SLICES, descending;
    rows_in_another_order: ROWS, second_first;
    padded_neurons_of_tiles: TILES, unmasked;
    padded_neurons_of_slices: SLICES, unmasked;
    padded_neurons_of_rows: ROWS, unmasked;
    one_slice_twice: SLICES, with("select(next, ", "select(first, ");
    one_slot_for_both_slices: SLICES, with("turn = 1u - turn;", "");
    a_neuron_twice: ROWS, with("let n_1 = min(lane, ", "let n_1 = min(lane | 1u, ");
    a_trajectory_of_a_neighbour: ROWS, with("let h_0_1 = odd[1u", "let h_0_1 = odd[2u");
}
