// One workgroup computes WORKGROUP neurons of one dense layer for WORKGROUP trajectories, a tile per
// thread. Activations are [width / 4, stride] vectors of 4 neurons, the state is laid out like the
// input's. Reads the parameters and the source; writes the sink. Twin: backend/cpu/mlp.rs.

@group(0) @binding(15) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(16) var<storage, read_write> sink: array<vec4<f32>>;

fn input_at(quad: u32, column: u32) -> vec4<f32> {
    return source[quad * params.stride + column];
}

fn put(quad: u32, column: u32, neurons: vec4<f32>) {
    sink[quad * params.stride + column] = neurons;
}

@compute @workgroup_size(WORKGROUP)
fn mlp(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let column = group.x * WORKGROUP + lane % TILE_PITCH;
    let quad = 2u * (group.y * TILE_PITCH + lane / TILE_PITCH);
    if quad >= params.layer_outputs {
        return;
    }
    let layer = Layer(
        params.layer_offset,
        params.layer_inputs,
        params.layer_outputs,
        params.layer_neurons,
    );
    put_tile(layer, quad, column, tile_of(layer, quad, column));
}
