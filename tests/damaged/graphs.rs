//! Graphs whose operations look like those of a dense network and are not: each is refused by name, or is right.

use super::made::{
    WEIGHTS, attribute, field, graph, is, layer, node, node_with, order, outcome, places, raw,
    refused, square, sums, tensor, word,
};

#[test]
fn every_operand_of_a_maximum_counts() {
    let scalars = || vec![square(), tensor("a", &[], &[0.0]), tensor("b", &[], &[0.5])];
    let several =
        || vec![square(), tensor("a", &[4], &[0.0, 1.0, 2.0, 3.0]), tensor("b", &[1], &[1.5])];
    let each = |f: fn(f32, f32) -> f32, limits: [f32; 4]| {
        move |x: &[f32]| -> Vec<f32> {
            sums(x).iter().zip(limits).map(|(&sum, limit)| f(sum, limit)).collect()
        }
    };
    for text in ["Max s a b -> y", "Max a s b -> y", "Max a b s -> y"] {
        is(each(f32::max, [0.5; 4]), &[0, 4], &[layer("x", "s"), node(text)], &scalars());
        let limits = [1.5, 1.5, 2.0, 3.0];
        is(each(f32::max, limits), &[0, 4], &[layer("x", "s"), node(text)], &several());
    }
    let least = node("Min s a b -> y");
    is(each(f32::min, [0.0, 1.0, 1.5, 1.5]), &[0, 4], &[layer("x", "s"), least], &several());
    // Of constants alone.
    let [joint, added] = [node("Max a b c -> k"), node("Add s k -> y")];
    let mut tensors = several();
    tensors.push(tensor("c", &[4], &[9.0, 0.0, 0.0, 9.0]));
    let plus = |x: &[f32]| -> Vec<f32> {
        sums(x).iter().zip([9.0, 1.5, 2.0, 9.0]).map(|(s, k)| s + k).collect()
    };
    is(plus, &[0, 4], &[layer("x", "s"), joint, added], &tensors);
}

#[test]
fn what_is_cut_off_is_no_smooth_activation() {
    let limits = |limit: f32| {
        vec![
            square(),
            tensor("l", &[], &[-limit]),
            tensor("u", &[], &[limit]),
            tensor("one", &[], &[1.0]),
        ]
    };
    for limit in [30.0, 50.0, 1e6, 1e9] {
        let silu = ["Clip s l u -> c", "Sigmoid s -> g", "Mul c g -> y"].map(node);
        refused(
            &["no activation that is known"],
            &[0, 4],
            &[vec![layer("x", "s")], silu.to_vec()].concat(),
            &limits(limit),
        );
        let softplus = ["Clip s l u -> c", "Exp c -> e", "Add e one -> d", "Log d -> y"].map(node);
        refused(
            &["no activation that is known"],
            &[0, 4],
            &[vec![layer("x", "s")], softplus.to_vec()].concat(),
            &limits(limit),
        );
    }
    // A bend far away, which nothing cuts off.
    let bent =
        ["Sigmoid s -> g", "Mul s g -> c", "Sub s u -> d", "Relu d -> e", "Add c e -> y"].map(node);
    refused(
        &["no activation that is known"],
        &[0, 4],
        &[vec![layer("x", "s")], bent.to_vec()].concat(),
        &limits(60.0),
    );
    // Without any of it, both are what they are.
    let softplus = ["Exp s -> e", "Add e one -> d", "Log d -> y"].map(node);
    let network = outcome(&graph(
        &[0, 4],
        &[vec![layer("x", "s")], softplus.to_vec()].concat(),
        &limits(1.0),
    ));
    assert_eq!(network.unwrap().output().name(), "softplus");
}

#[test]
fn dimensions_are_followed() {
    let axis = || places("one", &[1], &[1]);
    let of = |nodes: &[Vec<u8>], others: Vec<Vec<u8>>, words: &[&str]| {
        let nodes = [vec![layer("x", "s")], nodes.to_vec()].concat();
        refused(words, &[0, 4], &nodes, &[vec![square(), axis()], others].concat());
    };
    let gather = node_with("Gather u zero -> y", &[attribute("axis", 1)]);
    let first = vec![places("zero", &[], &[0])];
    of(&[node("Unsqueeze s one -> u"), gather], first, &["`Gather`", "[inputs, 1, 4]"]);
    of(
        &[node_with("Transpose s -> y", &[order("perm", &[1, 0])])],
        vec![],
        &["output", "transposed"],
    );
    of(
        &[node("Reshape s to -> y")],
        vec![places("to", &[2], &[-1, 2])],
        &["`Reshape`", "[inputs, 4]"],
    );
    of(&[node_with("Flatten s -> y", &[attribute("axis", 0)])], vec![], &["`Flatten`"]);
    let mixed = vec![places("to", &[2], &[4, -1])];
    of(&[node("Reshape s to -> y")], mixed, &["`Reshape`"]);
    let weight = || tensor("V", &[3, 3], &WEIGHTS[..9]);
    refused(&["`MatMul`", "counts inputs"], &[3, 3], &[node("MatMul V x -> y")], &[weight()]);
    // The same numbers in other dimensions, and a product on columns.
    let there = ["Unsqueeze s one -> u", "Reshape u to -> y"].map(node);
    let nodes = [vec![layer("x", "s")], there.to_vec()].concat();
    for to in [[-1, 4], [0, -1], [-1, 4]] {
        is(sums, &[0, 4], &nodes, &[square(), axis(), places("to", &[2], &to)]);
    }
    is(sums, &[4], &[node("MatMul W x -> y")], &[square()]);
    is(sums, &[4, 1], &[node("MatMul W x -> y")], &[square()]);
    let turned = ["Transpose x -> a", "MatMul W a -> b", "Transpose b -> y"].map(node);
    is(sums, &[0, 4], &turned, &[square()]);
}

#[test]
fn constants_leave_a_value_as_wide_as_it_is() {
    let narrow = || tensor("V", &[4, 1], &WEIGHTS[..4]);
    let three = |lengths: &[i64], numbers: [f32; 3]| vec![narrow(), tensor("b", lengths, &numbers)];
    for text in [
        "Add s b -> y",
        "Mul b s -> y",
        "Sub b s -> y",
        "Max s b -> y",
        "Pow s b -> y",
        "PRelu s b -> y",
    ] {
        let nodes = [node("MatMul x V -> s"), node(text)];
        refused(&["shape [3]", "[inputs, 1]"], &[0, 4], &nodes, &three(&[3], [0.5; 3]));
        refused(&["shape [1, 3]"], &[0, 4], &nodes, &three(&[1, 3], [2.0; 3]));
    }
    let column = || vec![square(), tensor("b", &[4, 1], &[0.0, 1.0, 2.0, 3.0])];
    let biased = node_with("Gemm x W b -> y", &[attribute("transB", 1)]);
    refused(&["`Gemm`", "shape [4, 1]"], &[0, 4], std::slice::from_ref(&biased), &column());
    refused(&["`Gemm`", "shape [4, 1]"], &[4, 4], &[biased], &column());
    refused(
        &["`Add`", "shape [4, 1]"],
        &[0, 4],
        &[layer("x", "s"), node("Add s b -> y")],
        &column(),
    );
    // On a column of numbers it is one for each.
    let plus = |x: &[f32]| -> Vec<f32> {
        sums(x).iter().zip([0.0, 1.0, 2.0, 3.0]).map(|(s, b)| s + b).collect()
    };
    is(plus, &[4, 1], &["MatMul W x -> s", "Add s b -> y"].map(node), &column());
}

#[test]
fn modes_and_domains_are_named() {
    let list = |name: &str| tensor(name, &[4], &[1.0; 4]);
    let tensors = [square(), list("a"), list("b"), list("m"), list("v")];
    let norm = node_with("BatchNormalization s a b m v -> y", &[attribute("training_mode", 1)]);
    refused(
        &["`BatchNormalization`", "training mode", "eval"],
        &[0, 4],
        &[layer("x", "s"), norm],
        &tensors,
    );
    let kernel = tensor("K", &[2, 1, 4], &WEIGHTS[..8]);
    let padded = node_with("Conv u K -> y", &[word("auto_pad", "SAME_UPPER")]);
    let nodes = [node("Unsqueeze x one -> u"), padded];
    refused(&["`Conv`", "SAME_UPPER"], &[0, 4], &nodes, &[kernel, places("one", &[1], &[1])]);
    let foreign = [layer("x", "y"), field(7, b"evil")].concat();
    refused(&["`Gemm` of the domain `evil`"], &[0, 4], &[foreign], &[square()]);
    let many = places("i", &[5000], &[0; 5000]);
    let gather = node_with("Gather x i -> y", &[attribute("axis", 1)]);
    refused(&["`Gather`", "5000 numbers", "4096"], &[0, 4], &[gather], &[many]);
    refused(&["no input"], &[0, 4], &[node("Relu x -> y")], &[tensor("x", &[4], &[0.0; 4])]);
}

#[test]
fn names_and_numbers_that_are_there_twice_are_refused() {
    let double = tensor("W", &[4, 4], &[2.0; 16]);
    refused(&["two tensors are called `W`"], &[0, 4], &[layer("x", "y")], &[square(), double]);
    let over = [node("Neg W -> W"), layer("x", "y")];
    refused(&["`Neg` gives `W`", "tensor"], &[0, 4], &over, &[square()]);
    let over = [layer("x", "a"), node("Neg a -> x"), layer("x", "y")];
    refused(&["`Neg` gives `x`", "input"], &[0, 4], &over, &[square()]);
    let bytes = |more: &[u8]| [square(), more.to_vec()].concat();
    let listed = bytes(&field(4, &5.0_f32.to_le_bytes().repeat(16)));
    refused(&["`W`", "twice"], &[0, 4], &[layer("x", "y")], &[listed]);
    let all: Vec<u8> = WEIGHTS.iter().flat_map(|weight| weight.to_le_bytes()).collect();
    let odd = raw("W", &[4, 4], 1, &[all, vec![1, 2]].concat());
    refused(&["`W`", "66 bytes"], &[0, 4], &[layer("x", "y")], &[odd]);
}

#[test]
fn a_claimed_width_takes_no_memory() {
    let tensors =
        [square(), tensor("k", &[], &[2.0]), tensor("l", &[], &[-1.0]), tensor("u", &[], &[1.0])];
    for width in [1 << 17, 1 << 27, 1 << 33, 1 << 40, 1 << 62] {
        for text in ["Mul x k -> a", "Clip x l u -> a", "Tanh x -> a"] {
            let words = [&*format!("{width} numbers"), "65536"];
            refused(&words, &[0, width], &[node(text), layer("a", "y")], &tensors);
        }
    }
    refused(&["at most 65536"], &[0, 1 << 40, 1 << 40], &[node("Mul x k -> y")], &tensors);
    // Layers that are made for activations alone, one after the other.
    let mut nodes = vec![node("Tanh x -> a0")];
    nodes.extend((0..20).map(|i| node(&format!("Tanh a{i} -> a{}", i + 1))));
    nodes.push(node("Tanh a20 -> y"));
    refused(&["operations between layers"], &[0, 4096], &nodes, &tensors);
}
