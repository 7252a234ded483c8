//! Buffers that are reused between calls.

use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use bytemuck::Pod;

use super::device::Device;
use super::traffic::Count;
use crate::error::{Fault, Result};

/// Bytes of free buffers that are kept for later calls.
const KEPT_BYTES: u64 = 256 << 20;
/// Smallest buffer, and the unit that larger ones are rounded up to.
const UNIT_BYTES: u64 = 1 << 16;

/// Buffers that no call uses now.
#[derive(Clone, Default)]
pub(super) struct Pool {
    free: Arc<Mutex<Vec<wgpu::Buffer>>>,
}

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Read and written by kernels, filled and copied by the host.
    Storage,
    /// Parameters.
    Uniform,
    /// What the host sends to kernels: parameters, and tables that they read.
    Inputs,
    /// Results on their way to the host.
    Readback,
    /// Times that queries found.
    Timestamps,
}

impl Use {
    fn flags(self) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as U;
        match self {
            Self::Storage => U::STORAGE | U::COPY_SRC | U::COPY_DST,
            Self::Uniform => U::UNIFORM | U::COPY_DST,
            Self::Inputs => U::UNIFORM | U::STORAGE | U::INDIRECT | U::COPY_DST,
            Self::Readback => U::MAP_READ | U::COPY_DST,
            Self::Timestamps => U::QUERY_RESOLVE | U::COPY_SRC,
        }
    }
}

impl Pool {
    /// A buffer of at least `bytes`, with whatever is left in it from earlier use.
    pub(super) fn take(&self, device: &Device, purpose: Use, bytes: u64) -> Buffer {
        let usage = purpose.flags();
        let limit = device.adapter.max_buffer_bytes.max(bytes);
        let size = bytes.max(1).next_multiple_of(UNIT_BYTES).min(limit);
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |buffer: &wgpu::Buffer| buffer.size() == size && buffer.usage() == usage;
        let inner = match free.iter().position(fits) {
            Some(at) => free.swap_remove(at),
            None => {
                device.counters.add(Count::Buffer);
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: None,
                    size,
                    usage,
                    mapped_at_creation: false,
                })
            }
        };
        Buffer { inner, bytes, reusable: true, pool: self.clone() }
    }

    /// Lets go of the buffers that no call uses.
    pub(super) fn clear(&self) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// Bytes of a buffer that the host has asked for.
pub(super) struct Mapping {
    bytes: u64,
    done: mpsc::Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
}

/// A buffer that returns to its pool.
pub(super) struct Buffer {
    inner: wgpu::Buffer,
    bytes: u64,
    reusable: bool,
    pool: Pool,
}

impl Buffer {
    /// Bytes asked for.
    pub(super) fn size(&self) -> u64 {
        self.bytes
    }

    /// The part asked for, as a kernel sees it.
    pub(super) fn binding(&self) -> wgpu::BufferBinding<'_> {
        wgpu::BufferBinding { buffer: &self.inner, offset: 0, size: NonZeroU64::new(self.bytes) }
    }

    /// `bytes` of it from `offset` on, as a kernel sees them.
    pub(super) fn part(&self, offset: u64, bytes: u64) -> wgpu::BufferBinding<'_> {
        wgpu::BufferBinding { buffer: &self.inner, offset, size: NonZeroU64::new(bytes) }
    }

    /// All of it, as commands other than kernels see it.
    pub(super) fn whole(&self) -> &wgpu::Buffer {
        &self.inner
    }

    /// Writes `data` at the start, before the next submission.
    pub(super) fn write<T: Pod>(&self, device: &Device, data: &[T]) {
        self.write_at(device, 0, bytemuck::cast_slice(data));
    }

    /// Writes `bytes` from `offset` on, before the next submission.
    pub(super) fn write_at(&self, device: &Device, offset: u64, bytes: &[u8]) {
        device.counters.add(Count::Write);
        device.counters.add_many(Count::BytesWritten, bytes.len() as u64);
        device.queue.write_buffer(&self.inner, offset, bytes);
    }

    /// Sets the buffer to 0 when `encoder` runs.
    pub(super) fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.inner, 0, None);
    }

    /// Copies its first `bytes` to `sink` from `offset` on when `encoder` runs.
    pub(super) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        sink: &Self,
        offset: u64,
        bytes: u64,
    ) {
        encoder.copy_buffer_to_buffer(&self.inner, 0, &sink.inner, offset, bytes);
    }

    /// The first `count` numbers, once all work submitted so far is done.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn read<T: Pod>(&self, device: &Device, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        let mut staging = self.pool.take(device, Use::Readback, bytes);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        self.copy(&mut encoder, &staging, 0, bytes);
        device.submit(encoder.finish())?;
        let mapping = staging.map(bytes);
        device.wait(None)?;
        staging.mapped(device, mapping, bytemuck::pod_collect_to_vec)
    }

    /// Asks for the first `bytes` of a buffer for readback, once all work submitted so far is done.
    pub(super) fn map(&mut self, bytes: u64) -> Mapping {
        // Until it is unmapped again, nobody else can use it.
        self.reusable = false;
        let (send, done) = mpsc::channel();
        self.inner.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
            // The receiver is gone only if the call failed, which is reported by itself.
            let _ = send.send(result);
        });
        Mapping { bytes, done }
    }

    /// What `take` makes of the bytes that `mapping` asked for, after a wait for that work.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if they cannot be read.
    pub(super) fn mapped<T>(
        &mut self,
        device: &Device,
        mapping: Mapping,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        let Mapping { bytes, done } = mapping;
        device.counters.add(Count::Read);
        device.counters.add_many(Count::BytesRead, bytes);
        let failed = |text: String| {
            device.failed(Fault::Validation, &format!("cannot read results: {text}"))
        };
        // The wait is over, but a thread that waits beside this one may be about to answer.
        match done.recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(failed(e.to_string())),
            Err(e) => return Err(failed(e.to_string())),
        }
        let view = self.inner.get_mapped_range(0..bytes);
        let taken = view.map(|view| take(&view)).map_err(|e| failed(e.to_string()));
        self.inner.unmap();
        self.reusable = true;
        taken
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let mut free = self.pool.free.lock().unwrap_or_else(PoisonError::into_inner);
        let kept: u64 = free.iter().map(wgpu::Buffer::size).sum();
        if self.reusable && kept + self.inner.size() <= KEPT_BYTES {
            free.push(self.inner.clone());
        }
    }
}
