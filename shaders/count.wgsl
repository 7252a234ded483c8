// One workgroup counts the measures, or signs, of COUNTED trajectories, and finds the least and the
// greatest with the first column that has it. Reads measures; writes a count for each workgroup. Numbers
// are compared by their bits, so that zeros, numbers that a driver would flush and what is no number
// count as on the host. Twin: `MeasureCounts` in rollout/measure_tally.rs.

const NO_COLUMN: u32 = 0xffffffffu;
const MAGNITUDE: u32 = 0x7fffffffu;
const SIGN: u32 = 0x80000000u;
// Place of both zeros in the order of all numbers.
const ZERO: u32 = 0x80000000u;
// Bits of an infinite number: beyond them, without a sign, lies what is no number.
const INFINITE: u32 = 0x7f800000u;

@group(0) @binding(7) var<storage, read> measures: array<f32>;
// Successes, those that are not finite, bits and column of the least, bits and column of the greatest.
@group(0) @binding(35) var<storage, read_write> counts: array<array<u32, 6>>;

// An extreme: its place in the order of all numbers, and its column.
var<workgroup> least: array<vec2<u32>, WORKGROUP>;
var<workgroup> greatest: array<vec2<u32>, WORKGROUP>;
// Successes, and those that are not finite.
var<workgroup> number: array<vec2<u32>, WORKGROUP>;

// The place of a number in the order of all numbers; both zeros have the same.
fn place(bits: u32) -> u32 {
    if (bits & MAGNITUDE) == 0u {
        return ZERO;
    }
    return select(bits | SIGN, ~bits, (bits & SIGN) != 0u);
}

fn lesser(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return select(a, b, b.x < a.x || (b.x == a.x && b.y < a.y));
}

fn larger(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return select(a, b, b.x > a.x || (b.x == a.x && b.y < a.y));
}

// Bits of the measure of `column`, if there is such a column.
fn bits_of(column: u32) -> u32 {
    if column == NO_COLUMN {
        return 0u;
    }
    return bitcast<u32>(measures[column]);
}

@compute @workgroup_size(WORKGROUP)
fn count(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let lost = place(bitcast<u32>(NON_FINITE));
    var low = vec2<u32>(NO_COLUMN, NO_COLUMN);
    var high = vec2<u32>(0u, NO_COLUMN);
    var found = vec2<u32>(0u, 0u);
    let end = min((group.x + 1u) * COUNTED, params.columns);
    for (var column = group.x * COUNTED + lane; column < end; column += WORKGROUP) {
        let bits = bitcast<u32>(measures[column]);
        if (bits & MAGNITUDE) > INFINITE {
            found.y += 1u;
            continue;
        }
        let at = place(bits);
        found += vec2<u32>(u32(at > ZERO), u32(at <= lost));
        low = lesser(low, vec2<u32>(at, column));
        high = larger(high, vec2<u32>(at, column));
    }
    least[lane] = low;
    greatest[lane] = high;
    number[lane] = found;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            least[lane] = lesser(least[lane], least[lane + half]);
            greatest[lane] = larger(greatest[lane], greatest[lane + half]);
            number[lane] += number[lane + half];
        }
    }
    if lane == 0u {
        let first = least[0].y;
        let last = greatest[0].y;
        counts[group.x] =
            array<u32, 6>(number[0].x, number[0].y, bits_of(first), first, bits_of(last), last);
    }
}
