//! Philox4x32-10, the counter-based generator of Salmon et al. (2011), for `N` lanes at once.

/// Multipliers of the two products.
const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// Increments of the two key words.
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
/// Rounds.
const ROUNDS: usize = 10;

/// The upper word of a product. Both words from one product of 64 bits would be the same, but that
/// is vectorised in wide lanes, at less than half the speed.
#[inline(always)]
fn high(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

/// Four random words per lane for a counter `[4][N]` and a key; twin: `philox` in
/// `shaders/rng.wgsl`.
#[inline(always)]
pub fn philox<const N: usize>(counter: [[u32; N]; 4], key: [u32; 2]) -> [[u32; N]; 4] {
    let [mut c0, mut c1, mut c2, mut c3] = counter;
    let [mut k0, mut k1] = key;
    for _ in 0..ROUNDS {
        for i in 0..N {
            let (left, right) = (c0[i], c2[i]);
            c0[i] = high(MULTIPLIERS[1], right) ^ c1[i] ^ k0;
            c1[i] = MULTIPLIERS[1].wrapping_mul(right);
            c2[i] = high(MULTIPLIERS[0], left) ^ c3[i] ^ k1;
            c3[i] = MULTIPLIERS[0].wrapping_mul(left);
        }
        k0 = k0.wrapping_add(WEYL[0]);
        k1 = k1.wrapping_add(WEYL[1]);
    }
    [c0, c1, c2, c3]
}

#[cfg(test)]
mod tests {
    use super::philox;

    /// The known-answer vectors of the Random123 distribution (`kat_vectors`, philox4x32 10).
    #[test]
    fn known_answers() {
        let cases = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, expected) in cases {
            let lanes = philox::<3>(counter.map(|word| [word; 3]), key);
            assert_eq!(lanes.map(|word| word[2]), expected);
        }
    }
}
