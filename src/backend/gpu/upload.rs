//! What the host sends with a submission: the parts of one buffer, one write.

use std::ops::Range;

use bytemuck::Pod;

use super::batch::{Batch, Counted};
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
    /// Bytes of the blocks that the device changes at a time.
    window: usize,
    /// What the device does not have yet.
    stale: Range<usize>,
}

impl Upload {
    /// Bytes that parts of `sizes` bytes and the parameters of `dispatches` dispatches take.
    pub(super) fn bytes(sizes: &[usize], dispatches: usize) -> usize {
        let parts = sizes.iter().map(|size| rounded(*size)).sum::<usize>();
        parts + Params::PITCH * dispatches
    }

    /// Room for parts of `sizes` bytes, and for the parameters of `dispatches` dispatches; the device
    /// itself changes those of up to `narrowed` at a time.
    pub(super) fn new(
        device: &Device,
        pool: &Pool,
        sizes: &[usize],
        dispatches: usize,
        narrowed: usize,
    ) -> Self {
        let (mut end, mut parts) = (0, Vec::with_capacity(sizes.len()));
        for size in sizes {
            parts.push(end..end + (*size).max(SMALLEST));
            end += rounded(*size);
        }
        let bytes = Self::bytes(sizes, dispatches);
        // What a kernel sees of the blocks from any of them on is as long as from the first.
        let window = narrowed * Params::PITCH;
        let buffer = pool.take(device, Use::Inputs, (bytes + window) as u64);
        Self { buffer, bytes: vec![0; bytes], parts, blocks: end, window, stale: 0..bytes }
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

    /// What a kernel that narrows dispatches sees of their parameters, at a dynamic offset.
    pub(super) fn narrowed(&self) -> wgpu::BufferBinding<'_> {
        self.buffer.part(self.blocks as u64, self.window as u64)
    }

    /// Where the parameters of the dispatches are, as dispatches see them whose workgroups the device
    /// counts.
    pub(super) fn counted(&self) -> Counted {
        Counted { buffer: self.buffer.whole().clone(), start: self.blocks as u64 }
    }

    /// Bytes of it.
    pub(super) fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Sets the numbers of `part` from number `at` on.
    pub(super) fn put<T: Pod>(&mut self, part: usize, at: usize, numbers: &[T]) {
        let start = self.parts[part].start + size_of::<T>() * at;
        self.set(start, bytemuck::cast_slice(numbers));
    }

    /// Sets `bytes` from byte `start` on; what is there already needs no write.
    fn set(&mut self, start: usize, bytes: &[u8]) {
        let end = start + bytes.len();
        if self.bytes[start..end] == *bytes {
            return;
        }
        self.bytes[start..end].copy_from_slice(bytes);
        let Range { start: first, end: last } = self.stale.clone();
        let none = self.stale.is_empty();
        self.stale = if none { start..end } else { first.min(start)..last.max(end) };
    }

    /// Writes what changed, and the parameters of `batch`, before the next submission: one write, and
    /// none where the device has it all.
    pub(super) fn write(&mut self, device: &Device, batch: &Batch<'_>) {
        self.set(self.blocks, batch.blocks());
        let stale = std::mem::take(&mut self.stale);
        if !stale.is_empty() {
            self.buffer.write_at(device, stale.start as u64, &self.bytes[stale]);
        }
        if batch.is_narrowed() {
            // The device is about to change them.
            self.stale = self.blocks..self.blocks + batch.blocks().len();
        }
    }
}

/// Parts begin at the largest alignment that an adapter may ask for, and none is empty.
fn rounded(size: usize) -> usize {
    size.max(SMALLEST).next_multiple_of(Params::PITCH)
}
