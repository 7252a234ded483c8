// One thread computes 8 neurons of one dense layer for 8 trajectories that lie MLP_LANES columns
// apart: a tile of registers, since the cost is that of loads. Activations are [width / 4, stride]
// vectors of 4 neurons, the state is laid out like the input's. Reads the layer's parameters and
// the source; writes the sink. Twin: backend/cpu/mlp.rs.

const TILE_COLUMNS: u32 = 8u;

// From `layer_offset`: biases [outputs / 4], then [inputs / 4, outputs / 4] blocks of 4 columns of
// 4 neurons; `layer_inputs` and `layer_outputs` count vectors, the latter an even number.
@group(0) @binding(14) var<storage, read> weights: array<vec4<f32>>;
@group(0) @binding(15) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(16) var<storage, read_write> sink: array<vec4<f32>>;

fn block(at: u32) -> mat4x4<f32> {
    return mat4x4<f32>(weights[at], weights[at + 1u], weights[at + 2u], weights[at + 3u]);
}

fn activated(sum: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(activation(sum.x), activation(sum.y), activation(sum.z), activation(sum.w));
}

@compute @workgroup_size(MLP_LANES)
fn mlp(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let column = group.x * MLP_LANES * TILE_COLUMNS + lane;
    let quad = 2u * group.y;
    let blocks = params.layer_offset + params.layer_outputs;
    let upper_bias = weights[params.layer_offset + quad];
    let lower_bias = weights[params.layer_offset + quad + 1u];
    var upper_0 = upper_bias;
    var lower_0 = lower_bias;
    var upper_1 = upper_bias;
    var lower_1 = lower_bias;
    var upper_2 = upper_bias;
    var lower_2 = lower_bias;
    var upper_3 = upper_bias;
    var lower_3 = lower_bias;
    var upper_4 = upper_bias;
    var lower_4 = lower_bias;
    var upper_5 = upper_bias;
    var lower_5 = lower_bias;
    var upper_6 = upper_bias;
    var lower_6 = lower_bias;
    var upper_7 = upper_bias;
    var lower_7 = lower_bias;
    for (var k = 0u; k < params.layer_inputs; k += 1u) {
        let at = blocks + 4u * (k * params.layer_outputs + quad);
        let upper = block(at);
        let lower = block(at + 4u);
        let here = k * params.stride + column;
        let x_0 = source[here];
        let x_1 = source[here + 1u * MLP_LANES];
        let x_2 = source[here + 2u * MLP_LANES];
        let x_3 = source[here + 3u * MLP_LANES];
        let x_4 = source[here + 4u * MLP_LANES];
        let x_5 = source[here + 5u * MLP_LANES];
        let x_6 = source[here + 6u * MLP_LANES];
        let x_7 = source[here + 7u * MLP_LANES];
        upper_0 += upper * x_0;
        lower_0 += lower * x_0;
        upper_1 += upper * x_1;
        lower_1 += lower * x_1;
        upper_2 += upper * x_2;
        lower_2 += lower * x_2;
        upper_3 += upper * x_3;
        lower_3 += lower * x_3;
        upper_4 += upper * x_4;
        lower_4 += lower * x_4;
        upper_5 += upper * x_5;
        lower_5 += lower * x_5;
        upper_6 += upper * x_6;
        lower_6 += lower * x_6;
        upper_7 += upper * x_7;
        lower_7 += lower * x_7;
    }
    let there = quad * params.stride + column;
    sink[there + 0u * MLP_LANES] = activated(upper_0);
    sink[there + params.stride + 0u * MLP_LANES] = activated(lower_0);
    sink[there + 1u * MLP_LANES] = activated(upper_1);
    sink[there + params.stride + 1u * MLP_LANES] = activated(lower_1);
    sink[there + 2u * MLP_LANES] = activated(upper_2);
    sink[there + params.stride + 2u * MLP_LANES] = activated(lower_2);
    sink[there + 3u * MLP_LANES] = activated(upper_3);
    sink[there + params.stride + 3u * MLP_LANES] = activated(lower_3);
    sink[there + 4u * MLP_LANES] = activated(upper_4);
    sink[there + params.stride + 4u * MLP_LANES] = activated(lower_4);
    sink[there + 5u * MLP_LANES] = activated(upper_5);
    sink[there + params.stride + 5u * MLP_LANES] = activated(lower_5);
    sink[there + 6u * MLP_LANES] = activated(upper_6);
    sink[there + params.stride + 6u * MLP_LANES] = activated(lower_6);
    sink[there + 7u * MLP_LANES] = activated(upper_7);
    sink[there + params.stride + 7u * MLP_LANES] = activated(lower_7);
}
