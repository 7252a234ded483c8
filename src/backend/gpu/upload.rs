//! What the host sends with a submission: the parts of one buffer, one write.

use std::ops::Range;

use bytemuck::Pod;

use super::batch::Batch;
use super::buffer::{Buffer, Pool, Use};
use super::device::Device;
use super::params::Params;

/// Smallest part, bytes: a vector of 4 numbers.
const SMALLEST: usize = 16;

/// Parts of one buffer, as the host has them and on the device; the last one has the parameters of
/// each dispatch.
pub(super) struct Upload {
    buffer: Buffer,
    bytes: Vec<u8>,
    parts: Vec<Range<usize>>,
    /// Where the parameters of the dispatches begin.
    blocks: usize,
    /// The device has what lies before.
    changed: usize,
}

impl Upload {
    /// Bytes that parts of `sizes` bytes and the parameters of `dispatches` dispatches take.
    pub(super) fn bytes(sizes: &[usize], dispatches: usize) -> usize {
        let parts = sizes.iter().map(|size| rounded(*size)).sum::<usize>();
        parts + Params::PITCH * dispatches
    }

    /// Room for parts of `sizes` bytes, and for the parameters of `dispatches` dispatches.
    pub(super) fn new(device: &Device, pool: &Pool, sizes: &[usize], dispatches: usize) -> Self {
        let (mut end, mut parts) = (0, Vec::with_capacity(sizes.len()));
        for size in sizes {
            parts.push(end..end + (*size).max(SMALLEST));
            end += rounded(*size);
        }
        let bytes = Self::bytes(sizes, dispatches);
        let buffer = pool.take(device, Use::Inputs, bytes as u64);
        Self { buffer, bytes: vec![0; bytes], parts, blocks: end, changed: 0 }
    }

    /// What a kernel sees of part `part`.
    pub(super) fn part(&self, part: usize) -> wgpu::BufferBinding<'_> {
        let Range { start, end } = self.parts[part];
        self.buffer.part(start as u64, (end - start) as u64)
    }

    /// What a kernel sees of the parameters of its dispatch, at a dynamic offset.
    pub(super) fn params(&self) -> wgpu::BufferBinding<'_> {
        self.buffer.part(self.blocks as u64, Params::SIZE.get())
    }

    /// Bytes of it.
    pub(super) fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Sets the numbers of `part` from number `at` on.
    pub(super) fn put<T: Pod>(&mut self, part: usize, at: usize, numbers: &[T]) {
        let start = self.parts[part].start + size_of::<T>() * at;
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        self.bytes[start..start + bytes.len()].copy_from_slice(bytes);
        self.changed = self.changed.min(self.parts[part].start);
    }

    /// Writes what changed, and the parameters of `batch`, before the next submission.
    pub(super) fn write(&mut self, device: &Device, batch: &Batch<'_>) {
        let blocks = batch.blocks();
        let end = self.blocks + blocks.len();
        self.bytes[self.blocks..end].copy_from_slice(blocks);
        let start = self.changed.min(self.blocks);
        self.buffer.write_at(device, start as u64, &self.bytes[start..end]);
        self.changed = self.blocks;
    }
}

/// Parts begin at the largest alignment that an adapter may ask for, and none is empty.
fn rounded(size: usize) -> usize {
    size.max(SMALLEST).next_multiple_of(Params::PITCH)
}
