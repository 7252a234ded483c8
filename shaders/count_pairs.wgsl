// One workgroup counts how COUNTED pairs fared. Reads their measures; writes a count for each workgroup.
// Numbers are compared by their bits, as in count.wgsl. Twin: `PairCounts` in rollout/pair_tally.rs.

const MAGNITUDE: u32 = 0x7fffffffu;
const SIGN: u32 = 0x80000000u;
// Bits of an infinite number: beyond them, without a sign, lies what is no number.
const INFINITE: u32 = 0x7f800000u;

@group(0) @binding(7) var<storage, read> pair_measures: array<vec2<f32>>;
// Accepted pairs, failures, those that reach, those that are not finite.
@group(0) @binding(35) var<storage, read_write> counts: array<vec4<u32>>;

var<workgroup> number: array<vec4<u32>, WORKGROUP>;

fn positive(bits: u32) -> bool {
    return bits > 0u && bits <= INFINITE;
}

// What is no number, or lies no higher than what fails for a state that is not finite.
fn broken(bits: u32) -> bool {
    let magnitude = bits & MAGNITUDE;
    let low = magnitude >= (bitcast<u32>(NON_FINITE) & MAGNITUDE) && (bits & SIGN) != 0u;
    return low || magnitude > INFINITE;
}

@compute @workgroup_size(WORKGROUP)
fn count_pairs(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    var found = vec4<u32>(0u, 0u, 0u, 0u);
    let end = min((group.x + 1u) * COUNTED, params.columns);
    for (var column = group.x * COUNTED + lane; column < end; column += WORKGROUP) {
        let bits = bitcast<vec2<u32>>(pair_measures[column]);
        let accepted = positive(bits.x);
        let reached = positive(bits.y);
        found += vec4<u32>(
            u32(accepted),
            u32(accepted && !reached),
            u32(reached),
            u32(broken(bits.x) || broken(bits.y)),
        );
    }
    number[lane] = found;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            number[lane] += number[lane + half];
        }
    }
    if lane == 0u {
        counts[group.x] = number[0];
    }
}
