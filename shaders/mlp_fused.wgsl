// The threads of a workgroup take its WORKGROUP trajectories through all layers of a network, a tile
// per thread and layer. Activations stay in workgroup memory, [widest / 4, WORKGROUP] vectors of 4
// neurons; outputs replace the inputs of their layer. Whoever calls it calls it with all threads.
// Twin: backend/cpu/mlp.rs.

var<workgroup> activations: array<vec4<f32>, FUSED_QUADS * WORKGROUP>;

fn input_at(quad: u32, column: u32) -> vec4<f32> {
    return activations[quad * WORKGROUP + column];
}

fn put(quad: u32, column: u32, neurons: vec4<f32>) {
    activations[quad * WORKGROUP + column] = neurons;
}

fn dense(layer: Layer, lane: u32) {
    let quad = 2u * (lane / TILE_PITCH);
    let column = lane % TILE_PITCH;
    var tile: Tile;
    if quad < layer.outputs {
        tile = tile_of(layer, quad, column);
    }
    // All inputs are read before the first is replaced.
    workgroupBarrier();
    if quad < layer.outputs {
        put_tile(layer, quad, column, tile);
    }
    workgroupBarrier();
}

// Controls at `x`, the state of trajectory `lane` of the workgroup at step `t`; further threads only
// help.
fn drive(lane: u32, column: u32, x: array<f32, NX>, t: u32) -> array<f32, NU> {
    // The outputs of the step before are read before they are replaced.
    workgroupBarrier();
    if lane < WORKGROUP {
        put_inputs(lane, observed(x, t));
    }
    workgroupBarrier();
    for (var i = 0u; i < LAYER_COUNT; i += 1u) {
        dense(layer_at(i), lane);
    }
    return acted(x, outputs_at(lane % WORKGROUP), t);
}
