// One thread takes the norm of one dense layer's sums for one trajectory, and the activation behind it. The sums are
// [width / 4, stride] vectors of 4 neurons, padded with 0. Reads the parameters; reads and writes the sink. Twin:
// `Normalising` in backend/cpu/mlp.rs.

@group(0) @binding(14) var<storage, read> weights: array<vec4<f32>>;
@group(0) @binding(16) var<storage, read_write> sink: array<vec4<f32>>;

// Which neurons of the vector `quad` are no padding.
fn neurons_of(quad: u32) -> vec4<bool> {
    return vec4<u32>(4u * quad) + vec4<u32>(0u, 1u, 2u, 3u) < vec4<u32>(params.layer_neurons);
}

// `total` and the four numbers, one after the other.
fn added(total: f32, numbers: vec4<f32>) -> f32 {
    return (((total + numbers.x) + numbers.y) + numbers.z) + numbers.w;
}

@compute @workgroup_size(WORKGROUP)
fn norm(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.stride {
        return;
    }
    let quads = params.layer_outputs;
    let count = f32(params.layer_neurons);
    var total = 0.0;
    for (var quad = 0u; quad < quads; quad += 1u) {
        total = added(total, sink[quad * params.stride + column]);
    }
    let mean = total / count;
    var squares = 0.0;
    for (var quad = 0u; quad < quads; quad += 1u) {
        let gap = sink[quad * params.stride + column] - mean;
        squares = added(squares, select(vec4<f32>(0.0), gap * gap, neurons_of(quad)));
    }
    let first = params.layer_offset;
    let variance = squares / count;
    // By its bits: a driver may take it that nothing is infinite.
    let factor = marked(normaliser(variance, weights[first].x), size_of(variance) >= INFINITE);
    for (var quad = 0u; quad < quads; quad += 1u) {
        let at = quad * params.stride + column;
        let scale = weights[first + 1u + quad];
        let shift = weights[first + 1u + quads + quad];
        let normed = (sink[at] - mean) * factor * scale + shift;
        let bent =
            vec4<f32>(activation(normed.x), activation(normed.y), activation(normed.z), activation(normed.w));
        sink[at] = select(vec4<f32>(0.0), bent, neurons_of(quad));
    }
}
