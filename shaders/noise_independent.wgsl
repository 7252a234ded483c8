// Noise that is independent at each step: step t takes draw t.

fn resume_noise(column: u32) {
}

fn noise_at(t: u32) -> array<f32, NU> {
    return draw(t);
}

fn suspend_noise(column: u32) {
}
