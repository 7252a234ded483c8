// One thread rolls one sample of one problem over the steps t = step .. step + steps - 1: noise
// becomes controls, stages are charged. Column p * width + k is the sample first_low + k of the
// problem p; the columns from `samples` to `width` are padding. Reads streams, plans and,
// where there are networks, their outputs (steps = 1 then); writes the state and the cost so far.
// Twin: backend/cpu/mppi_rollout.rs.

@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
// [problems, H, NU + NC]: nominal controls, then what the cost wants to know
@group(0) @binding(18) var<storage, read> plans: array<f32>;
@group(0) @binding(21) var<storage, read_write> totals: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn mppi_rollout(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    let place = column % params.width;
    if column >= params.columns || place >= params.samples {
        return;
    }
    let problem = column / params.width;
    open_source(problem, params.first_low + place);
    resume_noise(column);
    let first_step = streams[problem].w;
    var x = load_state(column);
    var total = totals[column];
    for (var t = params.step; t < params.step + params.steps; t += 1u) {
        let stage = problem * params.horizon + t;
        let nominal = plan_at(stage);
        let u = control_at(nominal, noise_at(t));
        total = charge(total, x, u, stage, nominal, first_step + t);
        x = advance(x, u, first_step + t);
        total = charge_value(column, total);
        x = disturb(column, x);
    }
    suspend_noise(column);
    store_state(column, x);
    totals[column] = total;
}
