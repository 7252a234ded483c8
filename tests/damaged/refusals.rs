//! Refusals of graphs: each has a graph that would be read wrongly without it.

use super::made::{
    WEIGHTS, attribute, field, layer, node, node_with, order, outcome, places, raw, refused,
    square, tensor, whole,
};

/// A graph of `W x` and these operations, with these constants, is refused with these words.
fn no(words: &[&str], nodes: &[Vec<u8>], tensors: &[Vec<u8>]) {
    let nodes = [vec![layer("x", "s")], nodes.to_vec()].concat();
    refused(words, &[0, 4], &nodes, &[vec![square()], tensors.to_vec()].concat());
}

/// The same of operations without attributes.
fn not(words: &[&str], texts: &[&str], tensors: &[Vec<u8>]) {
    no(words, &texts.iter().map(|text| node(text)).collect::<Vec<_>>(), tensors);
}

/// A float attribute.
fn float(name: &str, value: f32) -> Vec<u8> {
    let number = [vec![2 << 3 | 5], value.to_le_bytes().to_vec()].concat();
    [field(1, name.as_bytes()), number, whole(20, 1)].concat()
}

fn four(name: &str) -> Vec<u8> {
    tensor(name, &[4], &[1.0, 2.0, 3.0, 4.0])
}

#[test]
fn files_and_sizes() {
    let elsewhere = [square(), whole(14, 1)].concat();
    refused(&["`W`", "another file"], &[0, 4], &[layer("x", "y")], &[elsewhere]);
    let bare = |nodes: &[Vec<u8>], inputs: &[&[u8]]| {
        let named = inputs.iter().map(|name| field(11, &field(1, name)));
        let parts =
            [nodes.iter().flat_map(|content| field(1, content)).collect(), field(5, &square())];
        let parts: Vec<u8> =
            parts.into_iter().chain(named).chain([field(12, &field(1, b"y"))]).flatten().collect();
        outcome(&[whole(1, 9), field(7, &parts)].concat()).unwrap_err()
    };
    let states = bare(&[layer("x", "y")], &[b"x", b"h"]);
    assert!(states.contains("inputs `x, h`"), "{states}");
    let mut many = vec![layer("x", "a0")];
    many.extend((0..4096).map(|i| node(&format!("Relu a{i} -> a{}", i + 1))));
    many.push(node("Relu a4096 -> y"));
    refused(&["4098 operations", "4096"], &[0, 4], &many, &[square()]);
    // Constants that grow, one of 2^23 numbers and three such.
    let tall = tensor("t", &[4096, 1], &[0.0; 4096]);
    let wide = |width: usize| tensor("v", &[1, width as i64], &vec![0.0; width]);
    let grown = ["Add t v -> k", "Neg k -> l", "Neg l -> m", "Add s m -> y"];
    not(&["`Neg`", "16777216 numbers made"], &grown, &[tall.clone(), wide(2048)]);
    not(&["`Add`", "do not go together"], &["Add t v -> k", "Add s k -> y"], &[tall, wide(4097)]);
    refused(&["has no numbers"], &[0, 0], &[node("Add x n -> y")], &[tensor("n", &[0], &[])]);
    let none = tensor("n", &[4, 0], &[]);
    not(&["`n` has shape [4, 0]"], &["MatMul s n -> y"], &[none]);
    refused(&["no layer between"], &[0, 4], &[node("Identity x -> y")], &[]);
    let wide = 4097;
    let words = ["an operation before the first layer"];
    refused(&words, &[0, wide], &[node("Tanh x -> y")], &[]);
    // Layers that share their numbers.
    let shared = tensor("S", &[384, 384], &vec![0.5; 384 * 384]);
    let pair = |i: usize| [format!("MatMul a{i} S -> b{i}"), format!("Tanh b{i} -> a{}", i + 1)];
    let mut deep = vec![node("Identity x -> a0")];
    deep.extend((0..130).flat_map(pair).map(|text| node(&text)));
    deep.push(node("Identity a130 -> y"));
    refused(&["more than 64 layers"], &[0, 384], &deep, &[shared]);
    let [tall, flat] = [[4097, 1], [1, 4097]].map(|lengths| lengths.map(i64::from));
    let thin = |name: &str, lengths: &[i64]| tensor(name, lengths, &[0.0; 4097]);
    let product = [node("MatMul x T -> a"), node("MatMul a L -> y")];
    let words = ["product has 4097 x 4097"];
    refused(&words, &[0, 4097], &product, &[thin("T", &tall), thin("L", &flat)]);
}

#[test]
fn dimensions_and_orders() {
    let one = || places("one", &[1], &[1]);
    let twice = tensor("b", &[2, 1, 4], &[1.0; 8]);
    not(&["shape [2, 1, 4]"], &["Add s b -> y"], &[twice]);
    let product = |form: &[i64]| {
        let turned = places("to", &[form.len() as i64], form);
        (turned, ["Reshape s to -> r", "Relu r -> y"])
    };
    for form in [&[-1, 5][..], &[-1, 3], &[8, -1], &[4, -1], &[2, 2, 0], &[0, 5]] {
        let (turned, texts) = product(form);
        not(&["`Reshape`"], &texts, &[turned]);
    }
    // Columns, in which the numbers of one input do not lie side by side.
    let column = [node_with("Transpose s -> t", &[order("perm", &[1, 0])])];
    let turned = |next: Vec<u8>| [column.to_vec(), vec![next]].concat();
    no(&["`Reshape`"], &turned(node("Reshape t to -> y")), &[places("to", &[2], &[-1, 4])]);
    let deep = [node("Unsqueeze t end -> u"), node_with("Flatten u -> y", &[attribute("axis", 1)])];
    no(&["`Flatten`"], &[column.to_vec(), deep.to_vec()].concat(), &[places("end", &[1], &[2])]);
    let zero = node_with("Reshape s to -> y", &[attribute("allowzero", 1)]);
    no(&["`Reshape`"], &[zero], &[places("to", &[2], &[0, 4])]);
    not(&["`Squeeze`"], &["Squeeze s one -> y"], &[one()]);
    // The numbers of an input in rows and columns, turned.
    let grid =
        [node("Reshape s to -> r"), node_with("Transpose r -> t", &[order("perm", &[0, 2, 1])])];
    let back = node("Reshape t back -> y");
    let shapes = [places("to", &[3], &[-1, 2, 2]), places("back", &[2], &[-1, 4])];
    no(&["`Transpose`"], &[grid.to_vec(), vec![back]].concat(), &shapes);
    let some = node_with("Shape s -> l", &[attribute("start", 1)]);
    no(&["`Shape`", "some dimensions"], &[some, node("Reshape s l -> y")], &[]);
    // Lengths that count inputs are no numbers.
    let inputs = [node("Shape s -> l"), node("Reshape k l -> m"), node("Add s m -> y")];
    no(&["`Reshape`"], &inputs, &[tensor("k", &[1, 4], &[1.0; 4])]);
    let doubled = [
        node("Shape s -> l"),
        node("Gather l zero -> n"),
        node_with("Concat n n width -> m", &[attribute("axis", 0)]),
        node("Reshape s m -> y"),
    ];
    no(&["`Reshape`"], &doubled, &[places("zero", &[1], &[0]), places("width", &[1], &[4])]);
    // Lengths that are not known.
    let added = ["Shape x -> l", "Add l x -> y"].map(node);
    refused(&["of lengths and a value"], &[0, 0], &added, &[]);
    let up_to = ["Shape s -> l", "Gather l zero -> n", "Slice s zero n one -> y"].map(node);
    no(&["`Slice`", "ends are not known"], &up_to, &[places("zero", &[1], &[0]), one()]);
    let repeated = node_with("Transpose W -> V", &[order("perm", &[0, 0])]);
    no(&["`Transpose`"], &[repeated, node("MatMul s V -> y")], &[]);
    let joint = ["Unsqueeze s one -> u", "Add s u -> y"];
    not(&["`Add`", "[inputs, 4]", "[inputs, 1, 4]"], &joint, &[one()]);
}

#[test]
fn operations_of_one_number() {
    for (text, alike) in [("Selu s -> y", "constants of its own"), ("Swish s -> y", "alpha")] {
        no(&[alike], &[node_with(text, &[float("alpha", 1.5)])], &[]);
    }
    no(&["constants of its own"], &[node_with("Selu s -> y", &[float("gamma", 1.5)])], &[]);
    no(&["`Cast`", "another kind"], &[node_with("Cast s -> y", &[attribute("to", 7)])], &[]);
    not(&["`PRelu`", "slopes that differ"], &["PRelu s k -> y"], &[four("k")]);
    not(&["`Pow`", "powers that differ"], &["Pow s k -> y"], &[four("k")]);
    not(&["`Pow`", "both depend"], &["Pow s s -> y"], &[]);
    not(&["`Softmax`", "Gemm"], &["Softmax s -> y"], &[]);
    let turned = ["Pow k s -> y", "Div k s -> y", "Clip k s -> y"];
    for text in turned {
        not(&["in this order"], &[text], &[four("k")]);
    }
    not(&["`Clip`", "in this order"], &["Clip k k s -> y"], &[four("k")]);
    not(&["`Add`", "in this order"], &["Add k k s -> y"], &[four("k")]);
    let limits = [tensor("l", &[4], &[-1.0, -2.0, -3.0, -4.0]), tensor("u", &[2], &[1.0, 2.0])];
    not(&["`Clip`"], &["Clip s l u -> y"], &limits);
    // Between layers a clip is an activation: the same for all, its ends in order.
    let clip = ["Relu s -> r", "Clip r l u -> c", "Tanh c -> t", "MatMul t W -> y"];
    let differ = [tensor("l", &[4], &[0.5, 1.0, 1.5, 2.0]), tensor("u", &[], &[9.0])];
    not(&["not the same for all neurons"], &clip, &differ);
    let limit = |name: &str, value: f32| tensor(name, &[], &[value]);
    let crossed = ["Tanh s -> r", "Max r l -> a", "Min a u -> b", "Tanh b -> y"];
    not(&["a clip from 1 to 1"], &crossed, &[limit("l", 2.0), limit("u", 1.0)]);
    // Close to SiLU, and infinite where it is not.
    let near = ["Mul s k -> m", "Sigmoid m -> g", "Mul s g -> y"];
    not(&["no activation"], &near, &[limit("k", 1.002)]);
    let beyond = [
        "Sub s c -> d",
        "Reciprocal d -> i",
        "Mul i zero -> z",
        "Sigmoid s -> g",
        "Mul s g -> m",
        "Add m z -> y",
    ];
    not(&["no activation"], &beyond, &[limit("c", 5.0), limit("zero", 0.0)]);
}

#[test]
fn parts() {
    let one = || places("one", &[1], &[1]);
    let list = |name: &str, all: &[i64]| places(name, &[all.len() as i64], all);
    let slice = ["Slice s from to one steps -> y"];
    let ends = |from: i64, to: i64| vec![list("from", &[from]), list("to", &[to]), one()];
    not(&["`Slice`", "not there"], &slice, &[ends(0, 4), vec![list("steps", &[0])]].concat());
    not(&["`Slice`", "not there"], &slice, &[ends(0, 4), vec![list("steps", &[2, 2])]].concat());
    not(&["`Slice`", "not there"], &["Slice s from to one -> y"], &ends(3, 3));
    let split = |lengths: &[i64]| {
        let split = node_with("Split s parts -> y z", &[attribute("axis", 1)]);
        no(&["`Split`", "not there"], &[split], &[list("parts", lengths)]);
    };
    split(&[1, 1]);
    split(&[4, 0]);
    let halves = |next: &str| {
        let split = node_with("Split s parts -> a b", &[attribute("axis", 1)]);
        no(&["two parts"], &[split, node(next)], &[list("parts", &[2, 2])]);
    };
    halves("Add a b -> y");
    let together = |words: &str, first: &str, more: &[Vec<u8>]| {
        let split = node_with("Split s parts -> a b", &[attribute("axis", 1)]);
        let concat = node_with("Concat c b -> y", &[attribute("axis", 1)]);
        no(
            &["`Concat`", words],
            &[split, node(first), concat],
            &[&[list("parts", &[2, 2])], more].concat(),
        );
    };
    together("different functions", "Tanh a -> c", &[]);
    together("different dimensions", "Unsqueeze a first -> c", &[list("first", &[2])]);
    together("a constant", "Identity k -> c", &[tensor("k", &[1, 1], &[1.0])]);
    let along = |axis: &[Vec<u8>], words: &str| {
        no(&["`Concat`", words], &[node_with("Concat s s -> y", axis)], &[]);
    };
    along(&[attribute("axis", 0)], "counts inputs");
    along(&[], "without an axis");
    let nd = |attributes: &[Vec<u8>], places: Vec<u8>, words: &str| {
        let nodes = [node("Transpose s -> t"), node_with("GatherND t i -> y", attributes)];
        no(&["`GatherND`", words], &nodes, &[places]);
    };
    nd(&[], places("i", &[2], &[0, 1]), "one axis");
    nd(&[attribute("batch_dims", 1)], places("i", &[2, 1], &[0, 1]), "one axis");
    nd(&[], places("i", &[2, 1], &[0, 4]), "not there");
    let other = ["Slice s from to one -> a", "Softplus s -> p"];
    let picked = ["Greater a t -> g", "Where g a p -> y"];
    let twenty = tensor("t", &[], &[20.0]);
    not(
        &["`Where`"],
        &[&other[..], &picked].concat(),
        &[ends(1, 4), vec![twenty.clone()]].concat(),
    );
    let alike = ["Unsqueeze s one -> u", "Softplus s -> p", "Greater u t -> g", "Where g s p -> y"];
    not(&["`Where`"], &alike, &[one(), twenty.clone()]);
    // A softplus of another number than the one beside it.
    let moved = ["Mul s two -> m", "Softplus m -> p", "Greater s t -> g", "Where g s p -> y"];
    not(&["`Where`"], &moved, &[twenty, tensor("two", &[], &[2.0])]);
    let lengths = ["Shape s -> l", "Add l s -> y"];
    not(&["`Add`"], &lengths, &[]);
}

#[test]
fn layers_and_norms() {
    let of = |text: &str, attributes: &[Vec<u8>], words: &[&str], tensors: &[Vec<u8>]| {
        no(words, &[node_with(text, attributes)], tensors);
    };
    let flipped = [attribute("transA", 1), attribute("transB", 1)];
    of("Gemm s W -> y", &flipped, &["transA"], &[]);
    let deep = [node("Unsqueeze s one -> u"), node("Gemm u W -> y")];
    no(&["matrices alone"], &deep, &[places("one", &[1], &[1])]);
    not(
        &["4 numbers", "takes 3"],
        &["Add s b -> a", "MatMul a V -> y"],
        &[tensor("b", &[], &[1.0]), tensor("V", &[3, 3], &WEIGHTS[..9])],
    );
    let conv = |kernel: &[i64], attributes: &[Vec<u8>], words: &[&str]| {
        let count = kernel.iter().product::<i64>() as usize;
        let kernel = tensor("K", kernel, &WEIGHTS[..count]);
        let nodes = [node("Unsqueeze s one -> u"), node_with("Conv u K -> y", attributes)];
        no(words, &nodes, &[kernel, places("one", &[1], &[1])]);
    };
    let small = "kernel is not as large";
    conv(&[2, 1, 4], &[order("pads", &[1, 1])], &[small]);
    conv(&[2, 1, 4], &[order("dilations", &[2])], &[small]);
    conv(&[2, 1, 4], &[attribute("group", 2)], &[small]);
    conv(&[2, 1, 3], &[], &[small]);
    conv(&[2, 2, 2], &[], &["with a kernel [2, 2]"]);
    let nodes = [node("Unsqueeze s one -> u"), node("Conv u K b -> y")];
    let kernel = tensor("K", &[2, 1, 4], &WEIGHTS[..8]);
    let biased = [kernel, tensor("b", &[3], &[1.0, 2.0, 3.0]), places("one", &[1], &[1])];
    no(&["`b` has shape [3]"], &nodes, &biased);
    let five = ["a", "b", "m", "v"].map(four);
    of("BatchNormalization s a b m v -> y r q", &[], &["training mode"], &five);
    let short = [four("a"), four("b"), four("m"), tensor("v", &[3], &[1.0; 3])];
    of("BatchNormalization s a b m v -> y", &[], &["different lengths"], &short);
    let last = [node("Unsqueeze s one -> u"), node("BatchNormalization u a b m v -> y")];
    no(&["`BatchNormalization`"], &last, &[&five[..], &[places("one", &[1], &[1])]].concat());
    let norm = |axis: i64| node_with("LayerNormalization u a b -> y", &[attribute("axis", axis)]);
    let behind = |axis: i64| [node("Unsqueeze s end -> u"), norm(axis)];
    let end = || places("end", &[1], &[2]);
    no(&["`LayerNormalization`"], &behind(1), &[four("a"), four("b"), end()]);
    no(&["`LayerNormalization`"], &behind(2), &[four("a"), four("b"), end()]);
    let uneven = [four("a"), tensor("b", &[3], &[0.0; 3])];
    not(&["factors and summands"], &["LayerNormalization s a b -> y"], &uneven);
    let odd = raw("W", &[4, 4], 16, &[0; 32]);
    refused(&["`W`", "bfloat16"], &[0, 4], &[layer("x", "y")], &[odd]);
}
