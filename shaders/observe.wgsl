// One thread evaluates what a network sees of one trajectory's state before step `step`. Reads the
// state; writes vectors of 4 numbers, [inputs / 4, stride], as the first layer reads them. Twin:
// `Driver` in backend/cpu/tile.rs.

@group(0) @binding(3) var<storage, read> state: array<vec4<f32>>;
@group(0) @binding(16) var<storage, read_write> sink: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn observe(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    store_seen(column, observed(load_state(column), params.step));
}
