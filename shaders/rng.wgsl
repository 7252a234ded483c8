// Random numbers as functions of (key, stream, index, block). Twins: rollout/philox.rs and
// rollout/sample.rs; `normal_pair` and `ln_unit` are recorded from the latter.

const PHILOX_MULTIPLIER_0: u32 = 0xD2511F53u;
const PHILOX_MULTIPLIER_1: u32 = 0xCD9E8D57u;
const PHILOX_WEYL_0: u32 = 0x9E3779B9u;
const PHILOX_WEYL_1: u32 = 0xBB67AE85u;
const PHILOX_ROUNDS: u32 = 10u;
const ONE_BITS: u32 = 0x3f800000u;
const MANTISSA_SHIFT: u32 = 9u;
const HALF_WORD: u32 = 16u;
const HALF_MASK: u32 = 0xffffu;

// The upper word of a 64-bit product, from halves that cannot overflow.
fn mul_high(a: u32, b: u32) -> u32 {
    let a_low = a & HALF_MASK;
    let a_high = a >> HALF_WORD;
    let b_low = b & HALF_MASK;
    let b_high = b >> HALF_WORD;
    let low = a_low * b_low;
    let left = a_high * b_low + (low >> HALF_WORD);
    let right = a_low * b_high + (left & HALF_MASK);
    return a_high * b_high + (left >> HALF_WORD) + (right >> HALF_WORD);
}

// Philox4x32-10.
fn philox(start: vec4<u32>, start_key: vec2<u32>) -> vec4<u32> {
    var counter = start;
    var key = start_key;
    for (var i = 0u; i < PHILOX_ROUNDS; i += 1u) {
        let left_high = mul_high(PHILOX_MULTIPLIER_0, counter.x);
        let left_low = PHILOX_MULTIPLIER_0 * counter.x;
        let right_high = mul_high(PHILOX_MULTIPLIER_1, counter.z);
        let right_low = PHILOX_MULTIPLIER_1 * counter.z;
        counter = vec4<u32>(
            right_high ^ counter.y ^ key.x,
            right_low,
            left_high ^ counter.w ^ key.y,
            left_low,
        );
        key += vec2<u32>(PHILOX_WEYL_0, PHILOX_WEYL_1);
    }
    return counter;
}

// Uniform in [0, 1): the upper 23 bits become the mantissa, exactly.
fn unit(word: u32) -> f32 {
    return bitcast<f32>((word >> MANTISSA_SHIFT) | ONE_BITS) - 1.0;
}

// a * b, rounded before anything is added to it: a driver that contracts a * b + c would draw
// other starts than the host. It cannot know that `zero` is 0, so it must form the product's bits.
fn product(a: f32, b: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a * b) ^ params.zero);
}
