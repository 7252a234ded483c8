// Sums, quotients and roots with the bits that the host has, where a driver may reorder sums and
// miss a quotient or a root by SLACK units of the last place: each is mended by its remainder, an
// integer whose lower 32 bits say enough. Twins: + / and sqrt of f32.

const MANTISSA: u32 = 0x7fffffu;
const HIDDEN_BIT: u32 = 0x800000u;
const EXPONENT_SHIFT: u32 = 23u;
const EXPONENTS: u32 = 0xffu;
const BIAS: u32 = 127u;
const SLACK: u32 = 5u;

// a + b, rounded before anything is added to it: see `product`.
fn sum(a: f32, b: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a + b) ^ params.zero);
}

fn exponent_of(x: f32) -> u32 {
    return (bitcast<u32>(x) >> EXPONENT_SHIFT) & EXPONENTS;
}

fn significand_of(x: f32) -> u32 {
    return (bitcast<u32>(x) & MANTISSA) | HIDDEN_BIT;
}

// Neither 0 nor subnormal, infinite or NaN.
fn ordinary(x: f32) -> bool {
    return exponent_of(x) > 0u && exponent_of(x) < EXPONENTS;
}

// The significand of `near` where exponents are `exponent`, at an end of these where it lies beyond.
fn significand_at(near: f32, exponent: u32) -> u32 {
    let own = exponent_of(near);
    let end = select(HIDDEN_BIT, 2u * HIDDEN_BIT, own > exponent);
    return select(end, significand_of(near), own == exponent);
}

// The number of that significand, which may be twice HIDDEN_BIT.
fn assembled(exponent: u32, significand: u32) -> f32 {
    return bitcast<f32>((exponent << EXPONENT_SHIFT) + (significand - HIDDEN_BIT));
}

// a / b where both and the quotient are ordinary, or a is 0.
fn quotient(a: f32, b: f32) -> f32 {
    let near = a / b;
    if !(ordinary(a) && ordinary(b)) {
        return near;
    }
    let dividend = significand_of(a);
    let divisor = significand_of(b);
    let shift = select(0u, 1u, dividend < divisor);
    let exponent = exponent_of(a) + BIAS - exponent_of(b) - shift;
    var significand = significand_at(near, exponent);
    let step = bitcast<i32>(divisor);
    var rest = bitcast<i32>((dividend << (EXPONENT_SHIFT + shift)) - significand * divisor);
    for (var i = 0u; i < SLACK; i += 1u) {
        if rest < 0 {
            significand -= 1u;
            rest += step;
        } else if rest >= step {
            significand += 1u;
            rest -= step;
        }
    }
    significand += select(0u, 1u, 2 * rest > step);
    let magnitude = assembled(exponent, significand);
    return select(magnitude, -magnitude, ((bitcast<u32>(a) ^ bitcast<u32>(b)) >> 31u) == 1u);
}

// sqrt(x) where x is 0 or positive and ordinary.
fn root(x: f32) -> f32 {
    let near = sqrt(x);
    if !ordinary(x) {
        return select(near, x, x == 0.0);
    }
    let odd = (exponent_of(x) + 1u) & 1u;
    let exponent = (exponent_of(x) + BIAS - odd) / 2u;
    var significand = significand_at(near, exponent);
    let square = significand * significand;
    var rest = bitcast<i32>((significand_of(x) << (EXPONENT_SHIFT + odd)) - square);
    for (var i = 0u; i < SLACK; i += 1u) {
        if rest < 0 {
            significand -= 1u;
            rest += bitcast<i32>(2u * significand + 1u);
        } else if rest > bitcast<i32>(2u * significand) {
            rest -= bitcast<i32>(2u * significand + 1u);
            significand += 1u;
        }
    }
    significand += select(0u, 1u, rest > bitcast<i32>(significand));
    return assembled(exponent, significand);
}
