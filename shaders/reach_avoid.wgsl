// One thread rolls one trajectory over the states t = step .. step + steps - 1, the margins of
// each folded. Reads the schedule and, for a network, its controls (steps = 1 then); writes the
// state, the fold and the measure or its sign at the trajectory's place in the batch. Twin:
// backend/cpu/reach_avoid.rs.

@group(0) @binding(2) var<storage, read> schedule: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> folds: array<Fold>;
@group(0) @binding(5) var<storage, read> origin: array<u32>;
@group(0) @binding(7) var<storage, read_write> measures: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn reach_avoid(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    var x = load_state(column);
    var fold = folds[column];
    for (var t = params.step; t < params.step + params.steps; t += 1u) {
        if params.sign_only != 0u && decided(fold) {
            break;
        }
        fold = judge(fold, x, schedule[t].xyz);
        if t < params.horizon {
            x = advance(x, drive(column, x));
        }
    }
    store_state(column, x);
    folds[column] = fold;
    measures[origin[column]] = select(fold.best, measure_sign(fold), params.sign_only != 0u);
}
