//! Starts that the host lists, on the device: sent once, and there for the calls that ask for them again.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::{Buffer, Pool, Use};
use super::device::Device;
use crate::files::States;

/// Most lists that are kept.
const KEPT: usize = 64;
/// Most bytes of all of them.
const KEPT_BYTES: u64 = 64 << 20;

/// A list of starts on the device, `[states / 4, starts]` vectors of 4 numbers.
pub(super) struct List {
    /// No other list of the device has it; 0 is none.
    number: u64,
    size: usize,
    /// The numbers as the host gave them, `[starts, states]`.
    numbers: Vec<f32>,
    buffer: Buffer,
}

impl List {
    /// Whether it is `starts`, bit by bit.
    fn is(&self, starts: States<'_>) -> bool {
        let bytes = |numbers| bytemuck::cast_slice::<f32, u8>(numbers);
        self.size == starts.size() && bytes(&self.numbers) == bytes(starts.numbers())
    }
}

/// The lists that were asked for last, the latest last.
#[derive(Default)]
pub(super) struct Lists {
    kept: Mutex<Vec<Arc<List>>>,
    made: AtomicU64,
}

impl Lists {
    /// The list of `starts`: one that is there, or sent now.
    pub(super) fn get(&self, device: &Device, pool: &Pool, starts: States<'_>) -> Arc<List> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().rposition(|list| list.is(starts));
        let list = match found {
            Some(at) => kept.remove(at),
            None => Arc::new(self.sent(device, pool, starts)),
        };
        kept.push(Arc::clone(&list));
        let bytes = |kept: &[Arc<List>]| kept.iter().map(|list| list.buffer.size()).sum::<u64>();
        while kept.len() > KEPT || (kept.len() > 1 && bytes(&kept) > KEPT_BYTES) {
            kept.remove(0);
        }
        list
    }

    /// Sends `starts`.
    fn sent(&self, device: &Device, pool: &Pool, starts: States<'_>) -> List {
        let vectors = transposed(starts);
        let buffer = pool.take(device, Use::Storage, size_of_val(&vectors[..]) as u64);
        buffer.write(device, &vectors);
        let number = 1 + self.made.fetch_add(1, Ordering::Relaxed);
        List { number, size: starts.size(), numbers: starts.numbers().to_vec(), buffer }
    }

    /// Lets go of all of them.
    pub(super) fn clear(&self) {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// `[states / 4, starts]` vectors of 4 numbers, padded with 0.
fn transposed(starts: States<'_>) -> Vec<[f32; 4]> {
    let count = starts.len();
    let mut vectors = vec![[0.0; 4]; starts.size().div_ceil(4) * count];
    for (column, start) in starts.iter().enumerate() {
        for (quad, numbers) in start.chunks(4).enumerate() {
            vectors[quad * count + column][..numbers.len()].copy_from_slice(numbers);
        }
    }
    vectors
}

/// Where kernels read listed starts: a buffer of a workspace, and the list that it holds.
pub(super) struct Listed {
    buffer: Buffer,
    holds: u64,
}

impl Listed {
    /// Room for `starts` starts of `states` numbers.
    pub(super) fn new(device: &Device, pool: &Pool, states: usize, starts: u32) -> Self {
        let bytes = 16 * states.div_ceil(4) as u64 * u64::from(starts);
        Self { buffer: pool.take(device, Use::Storage, bytes), holds: 0 }
    }

    /// What kernels see of it.
    pub(super) fn binding(&self) -> wgpu::BufferBinding<'_> {
        self.buffer.binding()
    }

    /// Bytes of it.
    pub(super) fn size(&self) -> u64 {
        self.buffer.size()
    }

    /// Takes `list` over when `encoder` runs, unless it has it.
    pub(super) fn take(&mut self, encoder: &mut wgpu::CommandEncoder, list: &List) {
        if self.holds != list.number {
            list.buffer.copy(encoder, &self.buffer, 0, list.buffer.size());
            self.holds = list.number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_a_quad_lie_side_by_side() {
        let numbers: Vec<f32> = (0..15).map(|i| i as f32).collect();
        let vectors = transposed(States::new(&numbers, 5).unwrap());
        let first = [[0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0, 8.0], [10.0, 11.0, 12.0, 13.0]];
        assert_eq!(vectors[..3], first);
        assert_eq!(vectors[3..], [4.0, 9.0, 14.0].map(|x| [x, 0.0, 0.0, 0.0]));
    }
}
