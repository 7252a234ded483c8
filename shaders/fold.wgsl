// The reach-avoid measure, folded step by step. Twin: rollout/fold.rs.

struct Fold {
    // Smallest discounted constraint margin so far; -HUGE once something was not finite, which
    // no later margin can raise: the rollout is over.
    safe: f32,
    // The measure so far.
    best: f32,
}

fn empty_fold() -> Fold {
    return Fold(HUGE, -HUGE);
}

fn fold_add(fold: Fold, target_margin: f32, constraint_margin: f32, discount: f32) -> Fold {
    let safe = min(fold.safe, discount * constraint_margin);
    return Fold(safe, max(fold.best, min(safe, discount * target_margin)));
}

// Something is not finite: a failure, unless the target was reached before.
fn fold_fail(fold: Fold) -> Fold {
    return Fold(-HUGE, select(NON_FINITE, fold.best, fold.best > 0.0));
}

// Whether the sign of the measure is settled: reached, or not safe any more.
fn decided(fold: Fold) -> bool {
    return fold.best > 0.0 || fold.safe <= 0.0;
}

fn measure_sign(fold: Fold) -> f32 {
    if fold.best > 0.0 {
        return 1.0;
    }
    return select(NON_FINITE, -1.0, fold.best > NON_FINITE);
}
