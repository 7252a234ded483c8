// One thread rolls one pair side by side over the states t = step .. step + steps - 1. The
// nominal trajectory stands in column i, the perturbed one in column stride + i; threads from
// COLUMNS on only help to drive. Reads the schedule and, for a network, its outputs (steps = 1
// then) or its parameters; writes both states and folds, the pair's measures and its distance at
// each of these steps. Twin: backend/cpu/deviation.rs.

@group(0) @binding(2) var<storage, read> schedule: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> folds: array<Fold>;
@group(0) @binding(7) var<storage, read_write> pair_measures: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> distances: array<f32>;

// Distance of two states; HUGE where something is not finite.
fn gap(nominal: array<f32, NX>, perturbed: array<f32, NX>) -> f32 {
    let distance = state_distance(nominal, perturbed);
    let sound = state_finite(nominal) && state_finite(perturbed) && finite(distance);
    return select(HUGE, distance, sound);
}

@compute @workgroup_size(LANES)
fn deviation(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    // Columns are padded to whole workgroups; nothing is written beyond the last.
    let column = group.x * COLUMNS + lane % COLUMNS;
    let writes = lane < COLUMNS && column < params.columns;
    let second = params.stride + column;
    begin_drive(lane);
    var nominal = load_state(column);
    var perturbed = load_state(second);
    var nominal_fold = folds[column];
    var perturbed_fold = folds[second];
    for (var t = params.step; t < params.step + params.steps; t += 1u) {
        let row = schedule[t];
        if writes {
            let place = (t - params.segment_start) * params.stride + column;
            distances[place] = gap(nominal, perturbed);
        }
        nominal_fold = judge(nominal_fold, nominal, t, row);
        perturbed_fold = judge(perturbed_fold, perturbed, t, without_loss(row));
        if t < params.horizon {
            let replayed = drive(lane, column, nominal, t);
            if params.closed_loop != 0u {
                perturbed = advance(perturbed, drive(lane, second, perturbed, t), t);
            } else {
                perturbed = advance(perturbed, replayed, t);
            }
            nominal = advance(nominal, replayed, t);
        }
    }
    if !writes {
        return;
    }
    store_state(column, nominal);
    store_state(second, perturbed);
    folds[column] = nominal_fold;
    folds[second] = perturbed_fold;
    pair_measures[column] = vec2<f32>(nominal_fold.best, perturbed_fold.best);
}
