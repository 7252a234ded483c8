// Choices that hand a NaN on: a driver may turn a comparison into a maximum, which drops it, so it
// is told by its bits. Twin: the primitives of real/scalar.rs.

const SIGN_BIT: u32 = 0x80000000u;
const INFINITE: u32 = 0x7f800000u;

// Bits without the sign, in the order of absolute values, NaN above infinity.
fn size_of(x: f32) -> u32 {
    return bitcast<u32>(x) & ~SIGN_BIT;
}

// `x`, or the NaN that `largest` is.
fn unless_nan(x: f32, largest: u32) -> f32 {
    return select(x, bitcast<f32>(largest), largest > INFINITE);
}

fn lesser(a: f32, b: f32) -> f32 {
    return unless_nan(select(b, a, a < b), max(size_of(a), size_of(b)));
}

fn greater(a: f32, b: f32) -> f32 {
    return unless_nan(select(b, a, b < a), max(size_of(a), size_of(b)));
}

fn held(x: f32, low: f32, high: f32) -> f32 {
    let floored = select(x, low, x < low);
    let bounds = max(size_of(low), size_of(high));
    return unless_nan(select(floored, high, high < floored), max(size_of(x), bounds));
}

fn choose(a: f32, b: f32, yes: f32, no: f32) -> f32 {
    return unless_nan(select(no, yes, a < b), max(size_of(a), size_of(b)));
}

fn sign_of(x: f32) -> f32 {
    let rest = select(x, -1.0, x < 0.0);
    return unless_nan(select(rest, 1.0, 0.0 < x), size_of(x));
}

// `x`, or NaN where it is `lost`.
fn marked(x: f32, lost: bool) -> f32 {
    return bitcast<f32>(select(bitcast<u32>(x), 0x7fc00000u, lost));
}
