// Noise that is correlated with that of the step before, which `carry` keeps between dispatches.

// [NU, stride]
@group(0) @binding(23) var<storage, read_write> carry: array<f32>;

var<private> correlated: array<f32, NU>;

fn resume_noise(column: u32) {
    if params.step > 0u {
        for (var i = 0u; i < NU; i += 1u) {
            correlated[i] = carry[i * params.stride + column];
        }
    }
}

fn noise_at(t: u32) -> array<f32, NU> {
    let fresh = draw(t);
    if t == 0u {
        correlated = fresh;
    } else {
        correlated = recurrence(correlated, fresh);
    }
    return correlated;
}

fn suspend_noise(column: u32) {
    for (var i = 0u; i < NU; i += 1u) {
        carry[i * params.stride + column] = correlated[i];
    }
}
