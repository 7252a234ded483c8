// Judges the states of a rollout by their margins. Twin: `fold` in rollout/replay.rs.

// Bits of a number without its sign.
const MAGNITUDE: u32 = 0x7fffffffu;

// An infinite margin is satisfied or violated for good: as the largest number of its sign, whose bits
// are one below, the measure stays finite. A NaN stays one.
fn bounded(margin: f32) -> f32 {
    let bits = bitcast<u32>(margin);
    return select(margin, bitcast<f32>(bits - 1u), (bits & MAGNITUDE) == EXPONENT);
}

// A margin that loses `number`, or is multiplied with it.
fn act(margin: f32, number: f32, multiplied: bool) -> f32 {
    return bounded(select(margin - number, margin * number, multiplied));
}

// Adds the margins at `x`, the state at step `t`, to a fold. `row` of the schedule: discount, then
// what the target margin and the constraint margin lose, or their factors where the last is not 0.
fn judge(fold: Fold, x: array<f32, NX>, t: u32, row: vec4<f32>) -> Fold {
    let multiplied = row.w != 0.0;
    let target_margin = act(target_at(x, t), row.y, multiplied);
    let constraint_margin = act(constraint_at(x, t), row.z, multiplied);
    if !(state_finite(x) && finite(target_margin) && finite(constraint_margin)) {
        return fold_fail(fold);
    }
    return fold_add(fold, target_margin, constraint_margin, row.x);
}
