// Adds the margins at `x` to a fold. `row` of the schedule: discount, then what the target margin
// and the constraint margin lose. Twin: `fold` in rollout/reference.rs.
fn judge(fold: Fold, x: State, row: vec3<f32>) -> Fold {
    let target_margin = target_at(x) - row.y;
    let constraint_margin = constraint_at(x) - row.z;
    if !(state_finite(x) && finite(target_margin) && finite(constraint_margin)) {
        return fold_fail(fold);
    }
    return fold_add(fold, target_margin, constraint_margin, row.x);
}
