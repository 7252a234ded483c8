// Noise between knots: a step mixes the knots `first .. first + 3` of its row, of which those past
// the last have weight 0. Rows ascend by one knot at most, so a window of four moves along; a
// dispatch in the middle of a plan draws its first window anew.

const SUPPORT: u32 = 4u;

struct SplineRow {
    first: u32,
    weights: array<f32, 4>,
}

// [H]
@group(0) @binding(22) var<storage, read> spline: array<SplineRow>;

var<private> knots: array<array<f32, NU>, 4>;
// The knot after the window.
var<private> next_knot: u32;

fn resume_noise(column: u32) {
    next_knot = spline[params.step].first;
}

fn noise_at(t: u32) -> array<f32, NU> {
    let row = spline[t];
    while next_knot < row.first + SUPPORT {
        knots[0] = knots[1];
        knots[1] = knots[2];
        knots[2] = knots[3];
        knots[3] = draw(next_knot);
        next_knot += 1u;
    }
    return mixture(row.weights, knots[0], knots[1], knots[2], knots[3]);
}

fn suspend_noise(column: u32) {
}
