//! Plants whose formulas call networks, on the device: against f64 written from the mathematics.

use reachcast::backend::Backend;
use reachcast::backend::gpu::compose::{Kernel, PlantText};
use reachcast::rollout::{NON_FINITE, PairControl, Query};

use crate::gpu;
use crate::learned::batches::{assert_measures, assert_mutants_are_seen, assert_pairs, values};
use crate::learned::{LAWS, Law, plant, plant_of};

#[test]
fn measures_and_signs_of_learned_plants() {
    for law in LAWS {
        let Some(gpu) = gpu() else { return };
        assert_measures(&Backend::Gpu(gpu), law);
    }
}

#[test]
fn pairs_of_learned_plants() {
    for law in LAWS {
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let Some(gpu) = gpu() else { return };
            assert_pairs(&Backend::Gpu(gpu), law, control);
        }
    }
}

#[test]
fn mutants_of_learned_plants_are_seen() {
    let Some(gpu) = gpu() else { return };
    assert_mutants_are_seen(&Backend::Gpu(gpu));
}

/// A NaN in a network fails the rollout, on the device too.
#[test]
fn a_nan_in_a_network_fails_the_rollout() {
    let Some(gpu) = gpu() else { return };
    let text = Law::Formula
        .cart()
        .replacen(
            "'inside.safetensors', x, v)[0] - 0.1",
            "'drag.safetensors', log(0.5 - t), v)[0] - 9",
            1,
        )
        .replacen("1.4 - abs(x)", "9", 1);
    let found = values(&Backend::Gpu(gpu), &plant_of(&text), Query::Measure);
    assert!(found.iter().all(|value| *value == NON_FINITE), "{found:?}");
}

/// A kernel that is changed is another plant: what links hand on, and who acts in a pair, is seen.
#[test]
fn changed_links_are_seen() {
    let mutants = [
        ("kept[1u * row + column] = v[1]", "kept[1u * row + column] = v[0]"),
        (
            "let handed = array<f32, 2>(said[0u * row + column][0]",
            "let handed = array<f32, 2>(said[0u * row + column][1]",
        ),
        ("return x[2];", "return x[3];"),
    ];
    for (from, to) in mutants {
        let Some(gpu) = gpu() else { return };
        let plant = plant(Law::Formula);
        let text = PlantText::new(&plant.model, &plant.controller).expect("formulas that fit");
        let links = text.chain().expect("networks in formulas").count() as u32;
        let kernels = (0..links).map(Kernel::Link).chain([Kernel::ReachAvoid]);
        let all: Vec<String> = kernels.map(|kernel| text.compose(kernel)).collect();
        assert!(all.iter().any(|text| text.contains(from)), "{from}: {all:#?}");
        let gpu = gpu.with_shader_edit(move |text| text.replace(from, to));
        let backend = Backend::Gpu(gpu);
        let (farthest, _) = crate::learned::batches::farthest(&backend, &plant, Law::Formula);
        assert!(farthest > 1e-3, "{to} is not seen: {farthest}");
    }
}

/// A step of very many networks one after the other is for the CPU, and the error says so.
#[test]
fn too_long_a_chain_is_refused_with_the_remedy() {
    let Some(gpu) = gpu() else { return };
    let text = Law::Formula.cart().replacen("substeps = 2", "substeps = 20", 1);
    let backend = Backend::Gpu(gpu);
    let refused = backend.prepare(&plant_of(&text)).map(drop).expect_err("161 links").to_string();
    assert!(refused.contains("at most 128") && refused.contains("--backend cpu"), "{refused}");
}
