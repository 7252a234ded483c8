// One thread puts one column at the start of its problem, its cost at 0. Columns are the samples of
// the problems, `width` for each problem. Reads the starts; writes states and costs. Twin: `Tile`
// in backend/cpu/mppi_rollout.rs.

@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
// [problems, NX]
@group(0) @binding(20) var<storage, read> starts: array<f32>;
@group(0) @binding(21) var<storage, read_write> totals: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn mppi_start(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    store_state(column, start_of(column / params.width));
    totals[column] = 0.0;
}
