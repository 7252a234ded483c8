//! Operations of graphs that are followed: those that PyTorch writes softplus with, integers, and parts of the input.

use super::made::{
    WEIGHTS, attribute, graph, is, layer, node, node_with, outcome, places, refused, square, sums,
    tensor,
};

/// What no graph of 4 inputs is refused for: a layer, and then these operations.
fn after(texts: &[&str]) -> Vec<Vec<u8>> {
    [vec![layer("x", "s")], texts.iter().map(|text| node(text)).collect()].concat()
}

/// The weights, and constants of one number.
fn with(constants: &[(&str, f32)]) -> Vec<Vec<u8>> {
    let constants = constants.iter().map(|(name, value)| tensor(name, &[], &[*value]));
    [square()].into_iter().chain(constants).collect()
}

#[test]
fn a_softplus_with_a_threshold_is_one() {
    let named = |texts: &[&str], constants: &[(&str, f32)]| {
        let network = outcome(&graph(&[0, 4], &after(texts), &with(constants)));
        network.unwrap_or_else(|error| panic!("{error}")).output().name()
    };
    let whole = ["Softplus s -> p", "Greater s t -> g", "Where g s p -> y"];
    assert_eq!(named(&whole, &[("t", 20.0)]), "softplus");
    let scaled = ["Mul s b -> m", "Softplus m -> p", "Div p b -> d", "Greater m t -> g"];
    let scaled = [&scaled[..], &["Where g s d -> y"]].concat();
    assert_eq!(named(&scaled, &[("t", 20.0), ("b", 3.0)]), "softplus(3)");
    let written = ["Mul s b -> m", "Exp m -> e", "Add e one -> a", "Log a -> l", "Div l b -> d"];
    let written = [&written[..], &["Greater m t -> g", "Where g s d -> y"]].concat();
    assert_eq!(named(&written, &[("t", 20.0), ("b", 3.0), ("one", 1.0)]), "softplus(3)");
}

#[test]
fn lookalikes_of_a_softplus_with_a_threshold_are_refused() {
    let not = |texts: &[&str], constants: &[(&str, f32)]| {
        let words = ["`Where`", "no softplus", "nn.Softplus has 20"];
        refused(&words, &[0, 4], &after(texts), &with(constants));
    };
    let whole = ["Softplus s -> p", "Greater s t -> g", "Where g s p -> y"];
    for limit in [10.0, 0.0, -20.0, f32::NEG_INFINITY] {
        not(&whole, &[("t", limit)]);
    }
    let t = [("t", 20.0), ("b", 3.0), ("c", 2.0)];
    // Its input and itself the wrong way round, another input, other factors, and one that is no softplus.
    not(&["Softplus s -> p", "Greater s t -> g", "Where g p s -> y"], &t);
    not(&["Softplus s -> p", "Neg s -> n", "Greater s t -> g", "Where g n p -> y"], &t);
    not(&["Softplus s -> p", "Mul s b -> m", "Greater m t -> g", "Where g s p -> y"], &t);
    let other =
        ["Mul s b -> m", "Mul s c -> k", "Softplus m -> p", "Div p b -> d", "Greater k t -> g"];
    not(&[&other[..], &["Where g s d -> y"]].concat(), &t);
    not(&["Sigmoid s -> p", "Greater s t -> g", "Where g s p -> y"], &t);
    not(&["Softplus s -> p", "Neg s -> n", "Greater n t -> g", "Where g s p -> y"], &t);
    let moved = ["Softplus s -> p", "Add s b -> a", "Greater a t -> g", "Where g s p -> y"];
    not(&moved, &t);
}

#[test]
fn what_is_true_or_false_goes_nowhere_else() {
    let t = with(&[("t", 20.0)]);
    refused(&["`Neg`", "true or false"], &[0, 4], &after(&["Greater s t -> g", "Neg g -> y"]), &t);
    let both = after(&["Softplus s -> p", "Greater s p -> g", "Where g s p -> y"]);
    refused(&["`Greater`", "both depend"], &[0, 4], &both, &t);
    let picked = after(&["Greater s t -> g", "Where g s t -> y"]);
    refused(&["`Where`", "no two values"], &[0, 4], &picked, &t);
    let greatest = after(&["Greater s t -> g", "Max s g -> y"]);
    refused(&["`Max`", "different kinds"], &[0, 4], &greatest, &t);
    let differ = [square(), tensor("t", &[4], &[20.0, 20.0, 21.0, 20.0])];
    let limits = after(&["Softplus s -> p", "Greater s t -> g", "Where g s p -> y"]);
    refused(&["`Greater`", "limits that differ"], &[0, 4], &limits, &differ);
    refused(&["output", "true or false"], &[0, 4], &after(&["Greater s t -> y"]), &t);
    let numberless = with(&[("t", f32::NAN)]);
    refused(&["`Greater`"], &[0, 4], &limits, &numberless);
    // A comparison of what the network has gone on from, as any other value.
    let stale =
        [after(&["Greater s t -> g"]), vec![layer("s", "q")], vec![node("Where g q q -> y")]];
    refused(&["`g` branches into"], &[0, 4], &stale.concat(), &t);
}

/// What a slice from 0 up to `end`, an integer that operations make, leaves of `W x`.
fn sliced(width: usize, operations: &[Vec<u8>], numbers: &[(&str, i64)]) {
    let constants = numbers.iter().map(|(name, number)| places(name, &[1], &[*number]));
    let tensors = [square(), places("zero", &[1], &[0]), places("one", &[1], &[1])];
    let tensors = tensors.into_iter().chain(constants).collect::<Vec<_>>();
    let nodes =
        [vec![layer("x", "s")], operations.to_vec(), vec![node("Slice s zero end one -> y")]];
    is(|x| sums(x)[..width].to_vec(), &[0, 4], &nodes.concat(), &tensors);
}

#[test]
fn integers_are_divided_as_integers() {
    sliced(3, &[node("Div a b -> end")], &[("a", 7), ("b", 2)]);
    sliced(1, &[node("Div a b -> end")], &[("a", -7), ("b", 2)]);
    let chain = ["Div a b -> c", "Mul c b -> end"].map(node);
    sliced(2, &chain, &[("a", 3), ("b", 2)]);
    // They stay integers in other dimensions, and behind a cast.
    let scalar = || [node("Squeeze a one0 -> c"), node("Unsqueeze c one0 -> d")];
    let numbers = [("a", 7), ("b", 2), ("one0", 0)];
    let after =
        |more: &[&str]| [scalar().to_vec(), more.iter().map(|text| node(text)).collect()].concat();
    sliced(
        3,
        &after(&[
            "Div d b -> e",
            "Mul e b -> f",
            "Sub f b -> g",
            "Div g b -> h",
            "Add h one -> end",
        ]),
        &numbers,
    );
    let cast = node_with("Cast q -> end", &[attribute("to", 7)]);
    let real = node_with("Cast a -> r", &[attribute("to", 1)]);
    sliced(3, &[real, node("Div r b -> q"), cast], &[("a", 7), ("b", 2)]);
    let by_zero = [layer("x", "s"), node("Div a b -> end"), node("Slice s b end one -> y")];
    let tensors =
        [square(), places("a", &[1], &[4]), places("b", &[1], &[0]), places("one", &[1], &[1])];
    refused(&["`Div`", "by 0"], &[0, 4], &by_zero, &tensors);
    let half = [node_with("Cast W -> h", &[attribute("to", 10)]), node("MatMul x h -> y")];
    refused(&["`Cast`", "32 and 64 bits"], &[0, 4], &half, &[square()]);
}

#[test]
fn parts_of_the_input_go_into_the_layer_behind() {
    let picked = |x: &[f32]| sums(&[x[3], x[0], x[2], x[1]]);
    let order = || places("i", &[4], &[3, 0, 2, -3]);
    let gather = || node_with("Gather x i -> p", &[attribute("axis", 1)]);
    is(picked, &[0, 4], &[gather(), layer("p", "y")], &[square(), order()]);
    let network =
        outcome(&graph(&[0, 4], &[gather(), layer("p", "y")], &[square(), order()])).unwrap();
    assert_eq!(network.widths(), [4, 4], "a layer of its own");
    // Behind an activation, and in an order of what a norm gives.
    let curved = |x: &[f32]| picked(&x.iter().map(|x| x.tanh()).collect::<Vec<f32>>());
    let nodes = [
        node("Tanh x -> t"),
        node_with("Gather t i -> p", &[attribute("axis", 1)]),
        layer("p", "y"),
    ];
    is(curved, &[0, 4], &nodes, &[square(), order()]);
    let some = |x: &[f32]| WEIGHTS[..8].chunks(2).map(|w| w[0] * x[1] + w[1] * x[2]).collect();
    let slice = [node("Slice x from to one -> p"), node("MatMul p V -> y")];
    let turned: Vec<f32> = (0..2).flat_map(|j| (0..4).map(move |i| WEIGHTS[2 * i + j])).collect();
    let bounds = [places("from", &[1], &[1]), places("to", &[1], &[3]), places("one", &[1], &[1])];
    let tensors = [vec![tensor("V", &[2, 4], &turned)], bounds.to_vec()].concat();
    is(some, &[0, 4], &slice, &tensors);
    refused(
        &["`Gather`", "a part that is not there"],
        &[0, 4],
        &[gather(), layer("p", "y")],
        &[square(), places("i", &[4], &[0, 1, 2, 4])],
    );
}

/// Largest difference from f64 of a network that takes `(x - m) / d + t` of numbers far from 0, some of them or all.
fn far(nodes: &[Vec<u8>], more: &[Vec<u8>], places: &[usize]) -> f32 {
    let means = [1e6, -300.1, 9000.0, 101_325.0_f32];
    let some = |numbers: [f32; 4]| -> Vec<f32> { places.iter().map(|&i| numbers[i]).collect() };
    let count = places.len() as i64;
    let shift = [0.5, -1.0, 0.25, 2.0_f32][..places.len()].to_vec();
    // Others where a number is taken again.
    let own = some(means).into_iter().enumerate();
    let own: Vec<f32> = own.map(|(i, mean)| mean + i as f32).collect();
    let deviation = some([0.05, 2.0, 0.5, 40.0]).into_iter().enumerate();
    let deviation: Vec<f32> = deviation.map(|(i, d)| d * (1.0 + i as f32)).collect();
    let tensors = [("m", own.clone()), ("d", deviation.clone()), ("t", shift.clone())];
    let tensors = tensors.iter().map(|(name, numbers)| tensor(name, &[count], numbers));
    let tensors: Vec<Vec<u8>> = tensors.chain(more.iter().cloned()).collect();
    let network = outcome(&graph(&[0, 4], nodes, &tensors)).unwrap();
    let again = outcome(&reachcast::policy::onnx_bytes(&network)).unwrap();
    assert_eq!(again.digest(), network.digest(), "written and read");
    let near = [[0.0625, 1.0, -0.5, 8.0], [-0.125, 0.0, 0.25, -24.0_f32]];
    let apart = |by: &[f32; 4]| {
        let x: [f32; 4] = std::array::from_fn(|i| means[i] + by[i]);
        let found = network.forward(&x);
        let expected = (0..places.len()).map(|k| {
            let apart = f64::from(x[places[k]]) - f64::from(own[k]);
            (apart / f64::from(deviation[k]) + f64::from(shift[k])) as f32
        });
        found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    near.iter().map(apart).fold(0.0, f32::max)
}

#[test]
fn numbers_far_from_zero_keep_their_digits() {
    let one = |width: usize| {
        let row = |i: usize| (0..width).map(move |j| if i == j { 1.0 } else { 0.0 });
        tensor("I", &[width as i64; 2], &(0..width).flat_map(row).collect::<Vec<f32>>())
    };
    let normal = ["Sub x m -> a", "Div a d -> b", "Add b t -> c", "MatMul c I -> y"].map(node);
    assert!(far(&normal, &[one(4)], &[0, 1, 2, 3]) < 2e-6);
    let part = node_with("Gather x i -> p", &[attribute("axis", 1)]);
    let some = ["Sub p m -> a", "Div a d -> b", "Add b t -> c", "MatMul c I -> y"].map(node);
    let nodes = [vec![part.clone()], some.to_vec()].concat();
    assert!(far(&nodes, &[one(2), places("i", &[2], &[3, 0])], &[3, 0]) < 2e-6);
    // Behind what cuts off, some of them twice in two ways, and with a small number added first.
    let behind = |first: &[Vec<u8>]| {
        let some = ["Sub q m -> a", "Div a d -> b", "Add b t -> c", "MatMul c I -> y"].map(node);
        [first, &some].concat()
    };
    let limits = [tensor("low", &[], &[-1e3]), tensor("high", &[], &[2e6])];
    let clip = [&limits[..], &[one(4)]].concat();
    assert!(far(&behind(&[node("Clip x low high -> q")]), &clip, &[0, 1, 2, 3]) < 2e-6);
    let chosen = |count: usize, all: &[i64]| [one(count), places("i", &[count as i64], all)];
    let relu = [part.clone(), node("Relu p -> q")];
    assert!(far(&behind(&relu), &chosen(3, &[3, 0, 2]), &[3, 0, 2]) < 2e-6);
    let twice = [part, node("Identity p -> q")];
    assert!(far(&behind(&twice), &chosen(3, &[3, 0, 3]), &[3, 0, 3]) < 2e-6);
    let small = [&chosen(2, &[0, 0])[..], &[tensor("s", &[2], &[0.5, 0.25])]].concat();
    let added = ["Add q s -> e", "Sub e s -> f", "Sub f m -> a", "Div a d -> b", "Add b t -> y"];
    let nodes = [&twice[..], &added.map(node)].concat();
    assert!(far(&nodes, &small, &[0, 0]) < 2e-6);
}

#[test]
fn cuts_without_room_leave_a_number() {
    let limits = [square(), tensor("low", &[], &[3.0]), tensor("high", &[], &[3.0])];
    let nodes = [node("Clip x low high -> c"), layer("c", "y")];
    is(|_| sums(&[3.0; 4]), &[0, 4], &nodes, &limits);
    // The upper limit is the last word where they are the wrong way around, as in PyTorch and ONNX.
    let turned = [square(), tensor("low", &[], &[3.0]), tensor("high", &[], &[1.0])];
    is(|_| sums(&[1.0; 4]), &[0, 4], &nodes, &turned);
}

#[test]
fn inputs_turned_around_and_put_together_go_into_the_layer_behind() {
    let ends = |from: i64, to: i64, step: i64| {
        let all = [("from", from), ("to", to), ("axes", 1), ("step", step)];
        all.map(|(name, number)| places(name, &[1], &[number]))
    };
    let sliced = |from: i64, to: i64, step: i64, expected: &dyn Fn(&[f32]) -> Vec<f32>| {
        let nodes = [
            node("Slice x from to axes step -> p"),
            node_with("Gather p all -> q", &[attribute("axis", 1)]),
            layer("q", "y"),
        ];
        let all = places("all", &[4], &[0, -1, 0, -1]);
        let tensors = [&ends(from, to, step)[..], &[square(), all]].concat();
        is(|x| sums(&expected(x)), &[0, 4], &nodes, &tensors);
    };
    let pair = |x: &[f32], i: usize, j: usize| vec![x[i], x[j], x[i], x[j]];
    sliced(-1, i64::MIN, -1, &|x| pair(x, 3, 0));
    sliced(2, 0, -1, &|x| pair(x, 2, 1));
    sliced(-1, -9, -2, &|x| pair(x, 3, 1));
    sliced(0, i64::MAX, 2, &|x| pair(x, 0, 2));
    sliced(-3, 4, 2, &|x| pair(x, 1, 3));
    // A list of places in the first dimension.
    let order = places("i", &[4, 1], &[2, 0, 3, 1]);
    let nodes = ["Transpose x -> t", "GatherND t i -> p", "Transpose p -> q"].map(node);
    let nodes = [&nodes[..], &[layer("q", "y")]].concat();
    is(|x| sums(&[x[2], x[0], x[3], x[1]]), &[0, 4], &nodes, &[square(), order]);
    let split = node_with("Split x parts -> a b", &[attribute("axis", 1)]);
    let concat = || node_with("Concat b c -> p", &[attribute("axis", -1)]);
    let parts = || [square(), places("parts", &[2], &[1, 3]), tensor("k", &[], &[-0.5])];
    let nodes = [split.clone(), node("Identity a -> c"), concat(), layer("p", "y")];
    is(|x| sums(&[x[1], x[2], x[3], x[0]]), &[0, 4], &nodes, &parts());
    // Each with a map of its own, and behind a layer.
    let nodes = [split, node("Mul a k -> m"), node("Relu m -> c"), concat(), layer("p", "y")];
    let mapped = |x: &[f32]| sums(&[x[1], x[2], x[3], (-0.5 * x[0]).max(0.0)]);
    is(mapped, &[0, 4], &nodes, &parts());
    let split = node_with("Split s parts -> a b", &[attribute("axis", 1)]);
    let nodes = [
        layer("x", "s"),
        split,
        node("Mul a k -> m"),
        node("Neg m -> c"),
        concat(),
        layer("p", "y"),
    ];
    let turned = |x: &[f32]| sums(&[x[1], x[2], x[3], 0.5 * x[0]]);
    is(|x| turned(&sums(x)), &[0, 4], &nodes, &parts());
}

#[test]
fn a_map_of_nothing_has_no_limits() {
    let tensors = [square(), tensor("m", &[1], &[7.0]), tensor("z", &[1], &[0.0])];
    let nodes = [node("Sub x m -> a"), node("Mul a z -> b"), node("Add b m -> c"), layer("c", "y")];
    is(|_| sums(&[7.0; 4]), &[0, 4], &nodes, &tensors);
}

#[test]
fn what_branches_and_foreign_operators_have_a_way_out() {
    let skip = [layer("x", "s"), node("Relu s -> r"), layer("r", "t"), node("Add r t -> y")];
    let words = ["`r` branches into Gemm, Add", "skip connection", "net('FILE', ...)[0]"];
    refused(&words, &[0, 4], &skip, &[square()]);
    let foreign = [node("Gelu s -> y"), super::made::field(7, b"com.microsoft")].concat();
    let message = outcome(&graph(&[0, 4], &[layer("x", "s"), foreign], &[square()])).unwrap_err();
    assert!(message.contains("operators of ONNX alone") && !message.contains("Gemm"), "{message}");
}
