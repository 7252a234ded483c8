// One thread rolls one pair side by side over the states t = step .. step + steps - 1 and the points
// inside the periods behind them. Moments are counted in parts of a period, POINTS to a step; the
// schedule has two rows for each step, of its sample and of the points behind it, and so have the
// distances: that of the sample, and the largest of the points. Reads and writes what deviation.wgsl
// does else. Twin: backend/cpu/deviation.rs.

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
        let moment = POINTS * t;
        let row = schedule[2u * t];
        let place = 2u * (t - params.segment_start) * params.stride + column;
        if writes {
            distances[place] = gap(nominal, perturbed);
        }
        nominal_fold = judge(nominal_fold, nominal, moment, row);
        perturbed_fold = judge(perturbed_fold, perturbed, moment, without_loss(row));
        var farthest_between = 0.0;
        if t < params.horizon {
            let controls = drive(lane, column, nominal, moment);
            var beside = controls;
            if params.closed_loop != 0u {
                beside = drive(lane, second, perturbed, moment);
            }
            let between = schedule[2u * t + 1u];
            for (var point = 1u; point < POINTS; point += 1u) {
                let at = moment + point;
                nominal = advance(nominal, controls, at - 1u);
                perturbed = advance(perturbed, beside, at - 1u);
                farthest_between = max(farthest_between, gap(nominal, perturbed));
                nominal_fold = judge(nominal_fold, nominal, at, between);
                perturbed_fold = judge(perturbed_fold, perturbed, at, without_loss(between));
            }
            nominal = advance(nominal, controls, moment + POINTS - 1u);
            perturbed = advance(perturbed, beside, moment + POINTS - 1u);
        }
        if writes {
            distances[place + params.stride] = farthest_between;
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
