// Judges the states of a rollout by their margins. Twin: `fold` in rollout/replay.rs.

// Bits of a number without its sign.
const MAGNITUDE: u32 = 0x7fffffffu;
// In the last number of a row of the schedule: its bit that says that margins have factors, and where
// the role of the step begins.
const MULTIPLIED: u32 = 1u;
const ROLE_SHIFT: u32 = 1u;

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

// A margin where its step has one of the marks, 0 elsewhere.
fn seen(role: u32, marks: u32, margin: f32) -> f32 {
    return select(0.0, margin, (role & marks) != 0u);
}

// The row of the schedule for margins that lose nothing.
fn without_loss(row: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(row.x, 0.0, 0.0, f32(u32(row.w) & ~MULTIPLIED));
}

// Adds the margins at `x`, the state at step `t`, to a fold. `row` of the schedule: discount, then
// what the target margin and the constraint margin lose, or their factors, then a whole number: whether
// they are factors, and what the step is to the task.
fn judge(fold: Fold, x: array<f32, NX>, t: u32, row: vec4<f32>) -> Fold {
    let multiplied = (u32(row.w) & MULTIPLIED) != 0u;
    let role = u32(row.w) >> ROLE_SHIFT;
    if (role & LIVE) == 0u {
        return fold;
    }
    let tightened_target = act(target_at(x, t), row.y, multiplied);
    let target_margin = seen(role, CHANCE | REQUIREMENT, tightened_target);
    let tightened_constraint = act(constraint_at(x, t), row.z, multiplied);
    let constraint_margin = seen(role, CONSTRAINT, tightened_constraint);
    if !(state_finite(x) && finite(target_margin) && finite(constraint_margin)) {
        return fold_fail(fold);
    }
    return fold_add(fold, role, target_margin, constraint_margin, row.x);
}
