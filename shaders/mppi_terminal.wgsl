// One thread adds what the end of a plan costs to one column, once all stages were charged to it.
// Columns are the samples of the problems, `width` for each problem. Reads streams, states and, where
// the cost wants to know something, the rows behind the stages of all plans, one for each problem;
// writes the cost. Twin: `end` in tile/stages.rs and backend/cpu/interpreted_stages.rs.

@group(0) @binding(3) var<storage, read> state: array<vec4<f32>>;
// Per problem: key low, key high, stream id, number of the first step.
@group(0) @binding(17) var<storage, read> streams: array<vec4<u32>>;
@group(0) @binding(21) var<storage, read_write> totals: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn mppi_terminal(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns || column % params.width >= params.samples {
        return;
    }
    let problem = column / params.width;
    let stages = params.columns / params.width * params.horizon;
    let t = streams[problem].w + params.horizon;
    totals[column] += terminal_of(load_state(column), stages + problem, t);
}
