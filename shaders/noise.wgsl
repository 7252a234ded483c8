// The standard normal numbers of one sample: number n is entry n % 4 of the block n / 4. The block
// in use is kept, so numbers are cheap in ascending order. Twin: rollout/noise.rs.

const BLOCK_NUMBERS: u32 = 4u;
const NO_BLOCK: u32 = 0xffffffffu;

struct Source {
    key: vec2<u32>,
    stream: u32,
    index: u32,
    sign: f32,
    block: u32,
    normals: vec4<f32>,
}

// Per problem: key low, key high, stream id, number of the first step.
@group(0) @binding(17) var<storage, read> streams: array<vec4<u32>>;

var<private> source: Source;

// Turns to the noise of a sample.
fn open_source(problem: u32, sample: u32) {
    let stream = streams[problem];
    source.key = stream.xy;
    source.stream = stream.z;
    source.index = sample;
    source.sign = 1.0;
    if ANTITHETIC {
        source.index = sample / 2u;
        source.sign = select(1.0, -1.0, sample % 2u == 1u);
    }
    source.block = NO_BLOCK;
}

fn normal(number: u32) -> f32 {
    let block = number / BLOCK_NUMBERS;
    // Once at most: some drivers compute both sides of an `if`, but leave a loop out.
    while block != source.block {
        let counter = vec4<u32>(source.index, params.iteration, block, source.stream);
        let words = philox(counter, source.key);
        let even = normal_pair(1.0 - unit(words.x), unit(words.y));
        let odd = normal_pair(1.0 - unit(words.z), unit(words.w));
        source.normals = source.sign * vec4<f32>(even[0], even[1], odd[0], odd[1]);
        source.block = block;
    }
    return source.normals[number % BLOCK_NUMBERS];
}
