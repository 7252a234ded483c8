//! Counts that workgroups leave, as the host's tallies have them.

use super::compose::COUNTED;
use crate::rollout::{Extreme, MeasureCounts, PairCounts};

/// Words of a count of measures: successes, those that are not finite, and bits and column of the least
/// and of the greatest.
const MEASURE_WORDS: usize = 6;
/// Words of a count of pairs: accepted, failures, those that reach, those that are not finite.
const PAIR_WORDS: usize = 4;
/// The column of an extreme where no measure is a number.
const NO_COLUMN: u32 = u32::MAX;

/// Workgroups that count `columns` trajectories or pairs.
pub(super) fn groups(columns: u32) -> u32 {
    columns.div_ceil(COUNTED)
}

/// Bytes of the counts of `columns` measures.
pub(super) fn measure_bytes(columns: u32) -> u64 {
    u64::from(groups(columns)) * 4 * MEASURE_WORDS as u64
}

/// Bytes of the counts of `columns` pairs.
pub(super) fn pair_bytes(columns: u32) -> u64 {
    u64::from(groups(columns)) * 4 * PAIR_WORDS as u64
}

/// What `columns` starts came to, the first of which has the index `first`; `bytes` are the counts of
/// all workgroups.
pub(super) fn measures(first: u64, columns: u32, bytes: &[u8]) -> MeasureCounts {
    let mut all = MeasureCounts::default();
    for (group, count) in bytes.chunks_exact(4 * MEASURE_WORDS).enumerate() {
        let words: [u32; MEASURE_WORDS] = bytemuck::pod_read_unaligned(count);
        let [successes, non_finite, least, least_at, greatest, greatest_at] = words;
        let extreme = |bits, column| {
            let (measure, start) = (f32::from_bits(bits), first + u64::from(column));
            (column != NO_COLUMN).then_some(Extreme { measure, start })
        };
        all.merge(&MeasureCounts {
            starts: counted(columns, group),
            successes: u64::from(successes),
            non_finite: u64::from(non_finite),
            least: extreme(least, least_at),
            greatest: extreme(greatest, greatest_at),
        });
    }
    all
}

/// What `columns` pairs came to.
pub(super) fn pairs(columns: u32, bytes: &[u8]) -> PairCounts {
    let mut all = PairCounts::default();
    for (group, count) in bytes.chunks_exact(4 * PAIR_WORDS).enumerate() {
        let words: [u32; PAIR_WORDS] = bytemuck::pod_read_unaligned(count);
        let [accepted, failures, reached, non_finite] = words.map(u64::from);
        let pairs = counted(columns, group);
        all.merge(&PairCounts { pairs, accepted, failures, reached, non_finite });
    }
    all
}

/// How many of `columns` the workgroup number `group` counts.
fn counted(columns: u32, group: usize) -> u64 {
    u64::from(COUNTED).min(u64::from(columns) - u64::from(COUNTED) * group as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workgroups_are_merged_in_order() {
        let minus = (-2.0_f32).to_bits();
        let words = [[3, 1, minus, 7, 0, 9], [2, 0, minus, COUNTED, 0x8000_0000, COUNTED + 1]];
        let columns = COUNTED + 5;
        assert_eq!(measure_bytes(columns), size_of_val(&words) as u64);
        let counts = measures(100, columns, bytemuck::cast_slice(words.as_flattened()));
        assert_eq!((counts.starts, counts.successes, counts.non_finite), (4101, 5, 1));
        // Of equal ones the first, and both zeros are equal.
        assert_eq!(counts.least, Some(Extreme { measure: -2.0, start: 107 }));
        let greatest = counts.greatest.unwrap();
        assert_eq!((greatest.measure.to_bits(), greatest.start), (0, 109));
        let none = [0, 4, 0, NO_COLUMN, 0, NO_COLUMN];
        let counts = measures(0, 4, bytemuck::cast_slice(&none));
        assert_eq!((counts.least, counts.greatest, counts.non_finite), (None, None, 4));
    }

    #[test]
    fn pairs_are_added_up() {
        let words = [[5, 1, 6, 0], [1, 1, 0, 2]];
        let counts = pairs(COUNTED + 3, bytemuck::cast_slice(words.as_flattened()));
        let expected =
            PairCounts { pairs: 4099, accepted: 6, failures: 2, reached: 6, non_finite: 2 };
        assert_eq!(counts, expected);
    }
}
