// One thread rolls one trajectory over the states t = step .. step + steps - 1, the margins of
// each folded; threads from COLUMNS on only help to drive. Reads the schedule and, for a network,
// its outputs (steps = 1 then) or its parameters; writes the state, the fold and the measure or
// its sign at the trajectory's place in the batch. Twin: backend/cpu/reach_avoid.rs.

@group(0) @binding(2) var<storage, read> schedule: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> folds: array<Fold>;
@group(0) @binding(5) var<storage, read> origin: array<u32>;
@group(0) @binding(7) var<storage, read_write> measures: array<f32>;

@compute @workgroup_size(LANES)
fn reach_avoid(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    // Columns are padded to whole workgroups; nothing is written beyond the last.
    let column = group.x * COLUMNS + lane % COLUMNS;
    begin_drive(lane);
    var x = load_state(column);
    var fold = folds[column];
    for (var t = params.step; t < params.step + params.steps; t += 1u) {
        let settled = params.sign_only != 0u && decided(fold);
        if settled && !TOGETHER {
            break;
        }
        if !settled {
            fold = judge(fold, x, t, schedule[t]);
        }
        if t < params.horizon {
            x = advance(x, drive(lane, column, x, t), t);
        }
    }
    if lane >= COLUMNS || column >= params.columns {
        return;
    }
    store_state(column, x);
    folds[column] = fold;
    measures[origin[column]] = select(fold.best, measure_sign(fold), params.sign_only != 0u);
}
