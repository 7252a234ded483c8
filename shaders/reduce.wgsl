// One workgroup finds the largest distance of one step and the first column that attains it.
// Reads the distances [steps, stride]; writes (distance bits, column). Distances are never
// negative, so the order of their bits is their order. Twin: `Farthest::merge` in rollout/spec.rs.

const NO_COLUMN: u32 = 0xffffffffu;

@group(0) @binding(8) var<storage, read> distances: array<f32>;
@group(0) @binding(9) var<storage, read_write> farthest: array<vec2<u32>>;

var<workgroup> partial: array<vec2<u32>, WORKGROUP>;

fn farther(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return select(a, b, b.x > a.x || (b.x == a.x && b.y < a.y));
}

@compute @workgroup_size(WORKGROUP)
fn reduce(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let row = group.x;
    var mine = vec2<u32>(0u, NO_COLUMN);
    for (var column = lane; column < params.columns; column += WORKGROUP) {
        let bits = bitcast<u32>(distances[row * params.stride + column]);
        mine = farther(mine, vec2<u32>(bits, column));
    }
    partial[lane] = mine;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            partial[lane] = farther(partial[lane], partial[lane + half]);
        }
    }
    if lane == 0u {
        farthest[params.step + row] = partial[0];
    }
}
