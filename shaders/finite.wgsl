// Whether a number is finite, by its bits.

const EXPONENT: u32 = 0x7f800000u;

// Tests exponent bits: a driver may assume that there is no NaN and remove `x != x`.
fn finite(value: f32) -> bool {
    return (bitcast<u32>(value) & EXPONENT) != EXPONENT;
}
