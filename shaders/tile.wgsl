// 8 neurons of one dense layer for 8 trajectories that lie TILE_PITCH columns apart: a tile of
// registers, since the cost is that of loads. Reads the network's parameters; `input_at` and `put`
// of the kernel around it say where activations lie, in vectors of 4 neurons. Thread i of a
// workgroup takes the tile from neuron 8 (i / TILE_PITCH) and trajectory i % TILE_PITCH on: loads
// are shared both ways. Twin: backend/cpu/mlp.rs.

const TILE_COLUMNS: u32 = 8u;
const TILE_PITCH: u32 = WORKGROUP / TILE_COLUMNS;

struct Layer {
    // Of the biases [outputs / 4], which [inputs / 4, outputs / 4] blocks of 4 columns of 4 neurons
    // follow.
    offset: u32,
    // Vectors of 4; those of outputs are an even number.
    inputs: u32,
    outputs: u32,
    // Of those outputs, which are padded to whole tiles.
    neurons: u32,
}

struct Tile {
    upper_0: vec4<f32>,
    lower_0: vec4<f32>,
    upper_1: vec4<f32>,
    lower_1: vec4<f32>,
    upper_2: vec4<f32>,
    lower_2: vec4<f32>,
    upper_3: vec4<f32>,
    lower_3: vec4<f32>,
    upper_4: vec4<f32>,
    lower_4: vec4<f32>,
    upper_5: vec4<f32>,
    lower_5: vec4<f32>,
    upper_6: vec4<f32>,
    lower_6: vec4<f32>,
    upper_7: vec4<f32>,
    lower_7: vec4<f32>,
}

@group(0) @binding(14) var<storage, read> weights: array<vec4<f32>>;

fn block(at: u32) -> mat4x4<f32> {
    return mat4x4<f32>(weights[at], weights[at + 1u], weights[at + 2u], weights[at + 3u]);
}

// Sums of the neurons in the vectors `quad` and `quad + 1` for the trajectories from `column` on.
fn tile_of(layer: Layer, quad: u32, column: u32) -> Tile {
    let blocks = layer.offset + layer.outputs;
    let upper_bias = weights[layer.offset + quad];
    let lower_bias = weights[layer.offset + quad + 1u];
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
    for (var k = 0u; k < layer.inputs; k += 1u) {
        let at = blocks + 4u * (k * layer.outputs + quad);
        let upper = block(at);
        let lower = block(at + 4u);
        let x_0 = input_at(k, column);
        let x_1 = input_at(k, column + 1u * TILE_PITCH);
        let x_2 = input_at(k, column + 2u * TILE_PITCH);
        let x_3 = input_at(k, column + 3u * TILE_PITCH);
        let x_4 = input_at(k, column + 4u * TILE_PITCH);
        let x_5 = input_at(k, column + 5u * TILE_PITCH);
        let x_6 = input_at(k, column + 6u * TILE_PITCH);
        let x_7 = input_at(k, column + 7u * TILE_PITCH);
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
    return Tile(
        upper_0, lower_0, upper_1, lower_1, upper_2, lower_2, upper_3, lower_3,
        upper_4, lower_4, upper_5, lower_5, upper_6, lower_6, upper_7, lower_7,
    );
}

fn put_activated(layer: Layer, quad: u32, column: u32, sum: vec4<f32>) {
    let activated =
        vec4<f32>(activation(sum.x), activation(sum.y), activation(sum.z), activation(sum.w));
    // Weights of 0 do not keep a padded neuron at 0 where an input is infinite.
    let number = vec4<u32>(4u * quad) + vec4<u32>(0u, 1u, 2u, 3u);
    put(quad, column, select(vec4<f32>(0.0), activated, number < vec4<u32>(layer.neurons)));
}

fn put_tile(layer: Layer, quad: u32, column: u32, tile: Tile) {
    put_activated(layer, quad, column, tile.upper_0);
    put_activated(layer, quad + 1u, column, tile.lower_0);
    put_activated(layer, quad, column + 1u * TILE_PITCH, tile.upper_1);
    put_activated(layer, quad + 1u, column + 1u * TILE_PITCH, tile.lower_1);
    put_activated(layer, quad, column + 2u * TILE_PITCH, tile.upper_2);
    put_activated(layer, quad + 1u, column + 2u * TILE_PITCH, tile.lower_2);
    put_activated(layer, quad, column + 3u * TILE_PITCH, tile.upper_3);
    put_activated(layer, quad + 1u, column + 3u * TILE_PITCH, tile.lower_3);
    put_activated(layer, quad, column + 4u * TILE_PITCH, tile.upper_4);
    put_activated(layer, quad + 1u, column + 4u * TILE_PITCH, tile.lower_4);
    put_activated(layer, quad, column + 5u * TILE_PITCH, tile.upper_5);
    put_activated(layer, quad + 1u, column + 5u * TILE_PITCH, tile.lower_5);
    put_activated(layer, quad, column + 6u * TILE_PITCH, tile.upper_6);
    put_activated(layer, quad + 1u, column + 6u * TILE_PITCH, tile.lower_6);
    put_activated(layer, quad, column + 7u * TILE_PITCH, tile.upper_7);
    put_activated(layer, quad + 1u, column + 7u * TILE_PITCH, tile.lower_7);
}
