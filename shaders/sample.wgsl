// One thread draws one start, or one pair of starts, and empties its fold. Reads the region, or
// the starts that the host lists; writes states, folds and origins. Twin: rollout/sample.rs.

const REGION_BOX: u32 = 0u;
const REGION_BALL: u32 = 1u;
const NORMAL_PAIRS: u32 = (NX + 1u) / 2u;
const BLOCK_WORDS: u32 = 4u;

// One per coordinate: (low, high - low, -) of a box, (centre, half axis, varies) of a ball or an
// ellipsoid. Else the listed starts of the columns, see `listed_start`.
@group(0) @binding(1) var<storage, read> region: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> state: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> folds: array<Fold>;
@group(0) @binding(5) var<storage, read_write> origin: array<u32>;

// Index of a column's sample in the whole batch, low and high word.
fn sample_index(column: u32) -> vec2<u32> {
    let low = params.first_low + column;
    return vec2<u32>(low, params.first_high + select(0u, 1u, low < column));
}

fn box_start(index: vec2<u32>) -> array<f32, NX> {
    let key = vec2<u32>(params.key_low, params.key_high);
    var x: array<f32, NX>;
    var words: vec4<u32>;
    for (var i = 0u; i < NX; i += 1u) {
        if i % BLOCK_WORDS == 0u {
            words = philox(vec4<u32>(index, i / BLOCK_WORDS, params.stream), key);
        }
        x[i] = sum(region[i].x, product(unit(words[i % BLOCK_WORDS]), region[i].y));
    }
    return x;
}

// Uniform offset in the unit ball: z / sqrt(|z|^2 + 2 E), see rollout/sample.rs. `everywhere`
// lets all coordinates vary, else only those that the region marks.
fn ball_offset(
    key: vec2<u32>,
    stream: u32,
    index: vec2<u32>,
    everywhere: bool,
) -> array<f32, NX> {
    var normal: array<f32, NX>;
    var square = 0.0;
    var words: vec4<u32>;
    for (var pair = 0u; pair < NORMAL_PAIRS; pair += 1u) {
        let at = 2u * pair;
        if at % BLOCK_WORDS == 0u {
            words = philox(vec4<u32>(index, at / BLOCK_WORDS, stream), key);
        }
        let magnitude = 1.0 - unit(words[at % BLOCK_WORDS]);
        var both = normal_pair(magnitude, unit(words[at % BLOCK_WORDS + 1u]));
        for (var i = at; i < min(at + 2u, NX); i += 1u) {
            if everywhere || region[i].z > 0.0 {
                let z = both[i - at];
                normal[i] = z;
                square = sum(square, product(z, z));
            }
        }
    }
    let last = 2u * NORMAL_PAIRS;
    if last % BLOCK_WORDS == 0u {
        words = philox(vec4<u32>(index, last / BLOCK_WORDS, stream), key);
    }
    square = sum(square, product(-2.0, ln_unit(1.0 - unit(words[last % BLOCK_WORDS]))));
    let scale = quotient(1.0, root(square));
    for (var i = 0u; i < NX; i += 1u) {
        normal[i] = product(normal[i], scale);
    }
    return normal;
}

fn ball_start(index: vec2<u32>) -> array<f32, NX> {
    let key = vec2<u32>(params.key_low, params.key_high);
    var x = ball_offset(key, params.stream, index, false);
    for (var i = 0u; i < NX; i += 1u) {
        x[i] = sum(region[i].x, product(region[i].y, x[i]));
    }
    return x;
}

fn perturb(nominal: array<f32, NX>, index: vec2<u32>) -> array<f32, NX> {
    let key = vec2<u32>(params.pair_key_low, params.pair_key_high);
    var x = ball_offset(key, params.pair_stream, index, true);
    var center = nominal;
    for (var i = 0u; i < NX; i += 1u) {
        x[i] = sum(center[i], product(params.pair_radius, x[i]));
    }
    return x;
}

@compute @workgroup_size(WORKGROUP)
fn sample(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    let index = sample_index(column);
    var start: array<f32, NX>;
    if params.region_kind == REGION_BOX {
        start = box_start(index);
    } else if params.region_kind == REGION_BALL {
        start = ball_start(index);
    } else {
        start = listed_start(column);
    }
    store_state(column, start);
    folds[column] = empty_fold();
    origin[column] = column;
    if params.paired != 0u {
        store_state(params.stride + column, perturb(start, index));
        folds[params.stride + column] = empty_fold();
    }
}
