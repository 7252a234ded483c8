// What a driver may make of an operation: functions that the operators of a kernel are turned into.

const DRIVER_SIGN: u32 = 0x80000000u;
const DRIVER_EXPONENT: u32 = 0x7f800000u;
// Numbers whose products have an error that is a number too.
const DRIVER_LEAST: f32 = 1.0e-12f;
const DRIVER_MOST: f32 = 1.0e18f;

// `x`, a subnormal as 0 of its sign where FLUSHES.
fn driver_flushed(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let subnormal = (bits & DRIVER_EXPONENT) == 0u;
    return bitcast<f32>(select(bits, bits & DRIVER_SIGN, FLUSHES && subnormal));
}

// `x`, up to `most` units of the last place off, by its own bits; 0, infinity and NaN stay.
fn driver_missed(x: f32, most: u32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = bits & DRIVER_EXPONENT;
    let ordinary = exponent != 0u && exponent != DRIVER_EXPONENT;
    let off = ((bits * 2654435761u) >> 16u) % (2u * most + 1u);
    return bitcast<f32>(select(bits, bits + off - most, ordinary));
}

fn driver_quotient(a: f32, b: f32) -> f32 {
    let near = a / b;
    return driver_flushed(select(near, driver_missed(near, 2u), MISSES));
}

fn driver_root(x: f32) -> f32 {
    let near = sqrt(x);
    return select(near, driver_missed(near, 3u), MISSES);
}

fn driver_product(a: f32, b: f32) -> f32 {
    return driver_flushed(a * b);
}

// The 12 upper bits of a significand.
fn driver_upper(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u);
}

// A number that no compiler sees through.
fn driver_apart(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ params.zero);
}

// a * b + c, the product not rounded: its error, exact by halves, is added to the sum's own.
fn driver_contracted(a: f32, b: f32, c: f32) -> f32 {
    let product = driver_apart(a * b);
    let plain = driver_apart(product + c);
    let size = abs(product);
    if !(size > DRIVER_LEAST && size < DRIVER_MOST && abs(a) < DRIVER_MOST
        && abs(b) < DRIVER_MOST && abs(c) < DRIVER_MOST) {
        return driver_flushed(plain);
    }
    let a_upper = driver_upper(a);
    let b_upper = driver_upper(b);
    let a_lower = driver_apart(a - a_upper);
    let b_lower = driver_apart(b - b_upper);
    let first = driver_apart(a_upper * b_upper - product);
    let second = driver_apart(first + driver_apart(a_upper * b_lower));
    let third = driver_apart(second + driver_apart(a_lower * b_upper));
    let product_error = driver_apart(third + driver_apart(a_lower * b_lower));
    let large = select(product, c, abs(c) > size);
    let small = select(c, product, abs(c) > size);
    let sum_error = driver_apart(small - driver_apart(plain - large));
    return driver_flushed(plain + driver_apart(sum_error + product_error));
}
