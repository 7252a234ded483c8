// The measure of a trajectory by its task, folded step by step. Twin: rollout/fold.rs.

// What a step is to the task; twin: model/role.rs.
const LIVE: u32 = 1u;
const CONSTRAINT: u32 = 2u;
const CHANCE: u32 = 4u;
const REQUIREMENT: u32 = 8u;
const CONCLUSION: u32 = 16u;

struct Fold {
    // Smallest discounted margin so far of those that have to hold; -HUGE once something was not
    // finite, which no later margin can raise: the rollout is over.
    safe: f32,
    // The measure so far.
    best: f32,
}

fn empty_fold() -> Fold {
    return Fold(HUGE, -HUGE);
}

// Adds the margins of a state that is `role` to the task.
fn fold_add(
    fold: Fold,
    role: u32,
    target_margin: f32,
    constraint_margin: f32,
    discount: f32,
) -> Fold {
    var safe = fold.safe;
    if (role & CONSTRAINT) != 0u {
        safe = min(fold.safe, discount * constraint_margin);
    }
    if (role & REQUIREMENT) != 0u {
        safe = min(safe, discount * target_margin);
    }
    var best = fold.best;
    if (role & CHANCE) != 0u {
        best = max(best, min(safe, discount * target_margin));
    }
    if (role & CONCLUSION) != 0u {
        best = max(best, safe);
    }
    return Fold(safe, best);
}

// Something is not finite: a failure, unless the task was done before.
fn fold_fail(fold: Fold) -> Fold {
    return Fold(-HUGE, select(NON_FINITE, fold.best, fold.best > 0.0));
}

// Whether the sign of the measure is settled: success, or what has to hold does not.
fn decided(fold: Fold) -> bool {
    return fold.best > 0.0 || fold.safe <= 0.0;
}

fn measure_sign(fold: Fold) -> f32 {
    if fold.best > 0.0 {
        return 1.0;
    }
    return select(NON_FINITE, -1.0, fold.best > NON_FINITE);
}
