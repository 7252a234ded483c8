// One thread rolls one trajectory over the states t = step .. step + steps - 1 and the points inside
// the periods behind them, the margins of each folded; threads from COLUMNS on only help to drive.
// Moments are counted in parts of a period, POINTS to a step; the schedule has two rows for each
// step, of its sample and of the points behind it. Reads and writes what reach_avoid.wgsl does. Twin:
// backend/cpu/reach_avoid.rs.

@group(0) @binding(2) var<storage, read> schedule: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> folds: array<Fold>;
@group(0) @binding(5) var<storage, read> origin: array<u32>;
@group(0) @binding(7) var<storage, read_write> measures: array<f32>;

// Whether the sign is all that is asked for, and settled.
fn settled(fold: Fold) -> bool {
    return params.sign_only != 0u && decided(fold);
}

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
        if settled(fold) && !TOGETHER {
            break;
        }
        let moment = POINTS * t;
        if !settled(fold) {
            fold = judge(fold, x, moment, schedule[2u * t]);
        }
        if t < params.horizon {
            let controls = drive(lane, column, x, moment);
            for (var point = 1u; point < POINTS; point += 1u) {
                x = advance(x, controls, moment + point - 1u);
                if !settled(fold) {
                    fold = judge(fold, x, moment + point, schedule[2u * t + 1u]);
                }
            }
            x = advance(x, controls, moment + POINTS - 1u);
        }
    }
    if lane >= COLUMNS || column >= params.columns {
        return;
    }
    store_state(column, x);
    folds[column] = fold;
    measures[origin[column]] = select(fold.best, measure_sign(fold), params.sign_only != 0u);
}
