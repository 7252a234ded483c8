// One thread moves one trajectory whose sign is open to the front of a second set of buffers.
// Reads states, folds and origins; writes those of the survivors and their number. Their order
// is that of the atomic counter, but each result goes to its origin, so it does not matter.

@group(0) @binding(3) var<storage, read> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> folds: array<Fold>;
@group(0) @binding(5) var<storage, read> origin: array<u32>;
@group(0) @binding(10) var<storage, read_write> kept_state: array<vec4<f32>>;
@group(0) @binding(11) var<storage, read_write> kept_folds: array<Fold>;
@group(0) @binding(12) var<storage, read_write> kept_origin: array<u32>;
@group(0) @binding(13) var<storage, read_write> survivors: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn compact(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    let fold = folds[column];
    if decided(fold) {
        return;
    }
    let place = atomicAdd(&survivors, 1u);
    for (var quad = 0u; quad < STATE_QUADS; quad += 1u) {
        kept_state[quad * params.stride + place] = state[quad * params.stride + column];
    }
    kept_folds[place] = fold;
    kept_origin[place] = origin[column];
}
