//! The vectors of each instruction set against plain f32, bit by bit.

use std::marker::PhantomData;

use crate::backend::cpu::dispatch::{Unit, run};
use crate::backend::cpu::kernel::Kernel;
use crate::real::simd::{Body, Instructions};
use crate::real::{Real, Vector};

/// Numbers that the operations treat differently, and one that they do not.
const CASES: [f32; 12] = [
    0.0,
    -0.0,
    1.0,
    -1.5,
    0.3,
    2.5e-8,
    -7.9e6,
    1e30,
    f32::MIN_POSITIVE,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// The results of every operation on `a`, `b` and `c`.
fn operations<R: Real>(a: R, b: R, c: R) -> [R; 37] {
    let [sine, cosine] = a.principal_sin_cos();
    [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        a.abs(),
        a.sqrt(),
        a.floor(),
        a.if_lt(b, b, c),
        a.select_lt(b, b, c),
        a.if_le(b, c, a),
        a.if_eq(b, c, a),
        a.min(b),
        a.max(b),
        a.at_least(b),
        a.clamp(b, c),
        a.sign(),
        a.hypot(b),
        a.powi(3),
        a.powi(-2),
        a.powi(0),
        a.powf(0.5),
        a.powf(-1.3),
        sine,
        cosine,
        a.sin(),
        a.cos(),
        a.tan(),
        a.asin(),
        a.acos(),
        a.atan(),
        a.atan2(b),
        a.wrap(),
        a.exp(),
        a.ln(),
        a.tanh(),
        a.sigmoid(),
    ]
}

/// The operations on the first numbers of three rows, in vectors.
struct Operate<'a, K> {
    kernel: PhantomData<K>,
    rows: &'a [Vec<f32>; 3],
    at: usize,
}

impl<K: Kernel> Body for Operate<'_, K> {
    type Output = Vec<Vec<f32>>;

    #[inline(always)]
    fn run(self) -> Vec<Vec<f32>> {
        let load = |row: &Vec<f32>| K::Vector::load(&row[self.at..]);
        let [a, b, c] = self.rows;
        let results = operations(load(a), load(b), load(c));
        let stored = results.iter().map(|result| {
            let mut numbers = vec![0.0; K::Vector::WIDTH];
            result.store(&mut numbers);
            numbers
        });
        stored.collect()
    }
}

/// All triples of the cases.
struct Operations;

impl Unit for Operations {
    type Output = ();

    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        let width = K::Vector::WIDTH;
        assert_eq!(N % width, 0, "vectors fill the lanes of a group");
        let count = CASES.len();
        let all = (0..count.pow(3).next_multiple_of(width)).collect::<Vec<_>>();
        let row = |each: usize| all.iter().map(|i| CASES[i / each % count]).collect::<Vec<f32>>();
        let rows = [row(count * count), row(count), row(1)];
        for at in (0..all.len()).step_by(width) {
            let found = kernel.call(Operate::<K> { kernel: PhantomData, rows: &rows, at });
            for lane in 0..width {
                let [a, b, c] = rows.each_ref().map(|row| row[at + lane]);
                let expected = operations(a, b, c);
                for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                    let same = found[lane].to_bits() == expected.to_bits();
                    let nan = found[lane].is_nan() && expected.is_nan();
                    assert!(same || nan, "{i} of {a} {b} {c}: {} {expected}", found[lane]);
                }
            }
        }
    }
}

#[test]
fn every_operation_has_the_bits_of_f32() {
    for instructions in Instructions::detect() {
        run(instructions, Operations);
    }
}

/// The logarithm of numbers in `(0, 1]`, and each of them doubled by hand.
struct Logarithms<'a, K> {
    kernel: PhantomData<K>,
    numbers: &'a mut [f32],
}

impl<K: Kernel> Body for Logarithms<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for numbers in self.numbers.chunks_exact_mut(K::Vector::WIDTH) {
            K::Vector::load(numbers).ln_unit().each(|number| 2.0 * number).store(numbers);
        }
    }
}

/// Every number that the magnitude of a pair of normal numbers can be, and those next to where the
/// exponent changes and the range begins.
struct Magnitudes;

impl Unit for Magnitudes {
    type Output = ();

    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        let every = (1..=1 << 23_u32).map(|k| k as f32 / 8_388_608.0);
        let root = std::f32::consts::FRAC_1_SQRT_2.to_bits();
        let next = (0..23).flat_map(|halvings| {
            (root - 8..root + 8).map(move |bits| f32::from_bits(bits - (halvings << 23)))
        });
        let least = (1.0_f32 / 16_777_216.0).to_bits();
        let first = (least..least + 16).map(f32::from_bits);
        let numbers: Vec<f32> = every.chain(next).chain(first).collect();
        let mut found = numbers.clone();
        kernel.call(Logarithms::<K> { kernel: PhantomData, numbers: &mut found });
        for (found, number) in found.into_iter().zip(numbers) {
            let expected = 2.0 * Real::ln_unit(number);
            assert_eq!(found.to_bits(), expected.to_bits(), "{number}");
        }
    }
}

#[test]
fn the_logarithm_of_every_uniform_number_has_the_bits_of_f32() {
    for instructions in Instructions::detect() {
        run(instructions, Magnitudes);
    }
}
