//! Buffers: parameters of a dispatch, storage that is reused between calls, readback.

use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use bytemuck::{Pod, Zeroable};

use super::device::Device;
use crate::error::{Fault, Result};

/// Parameters of one dispatch; twin: `shaders/params.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(missing_docs, reason = "the names are those of the shader and say what they hold")]
pub struct Params {
    pub key_low: u32,
    pub key_high: u32,
    pub stream: u32,
    pub zero: u32,
    pub pair_key_low: u32,
    pub pair_key_high: u32,
    pub pair_stream: u32,
    pub pair_radius: f32,
    pub first_low: u32,
    pub first_high: u32,
    pub columns: u32,
    pub stride: u32,
    pub step: u32,
    pub steps: u32,
    pub horizon: u32,
    pub region_kind: u32,
    pub paired: u32,
    pub closed_loop: u32,
    pub sign_only: u32,
    pub layer_offset: u32,
    pub layer_inputs: u32,
    pub layer_outputs: u32,
    pub layer_neurons: u32,
    pub segment_start: u32,
    pub iteration: u32,
    pub samples: u32,
    pub width: u32,
    pub rounds: u32,
    pub temperature: f32,
}

impl Params {
    /// Bytes of the block.
    pub(super) const SIZE: NonZeroU64 = match NonZeroU64::new(size_of::<Self>() as u64) {
        Some(size) => size,
        None => panic!("the block of parameters is not empty"),
    };

    /// Bytes from one block to the next: the largest alignment that an adapter may ask for.
    pub(super) const PITCH: usize = 256;

    /// The parameters for `columns` trajectories from index `first` on.
    pub(super) fn at(mut self, first: u64, columns: u32) -> Self {
        self.first_low = first as u32;
        self.first_high = (first >> 32) as u32;
        self.columns = columns;
        self
    }

    /// The parameters for the steps `step..step + steps`.
    pub(super) fn over(mut self, step: u32, steps: u32) -> Self {
        self.step = step;
        self.steps = steps;
        self
    }
}

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
            None => device.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage,
                mapped_at_creation: false,
            }),
        };
        Buffer { inner, bytes, reusable: true, pool: self.clone() }
    }

    /// Lets go of the buffers that no call uses.
    pub(super) fn clear(&self) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// A buffer that returns to its pool.
pub(super) struct Buffer {
    inner: wgpu::Buffer,
    bytes: u64,
    reusable: bool,
    pool: Pool,
}

impl Buffer {
    /// The part asked for, as a kernel sees it.
    pub(super) fn binding(&self) -> wgpu::BufferBinding<'_> {
        wgpu::BufferBinding { buffer: &self.inner, offset: 0, size: NonZeroU64::new(self.bytes) }
    }

    /// Its first block of parameters, moved by a dynamic offset.
    pub(super) fn first_block(&self) -> wgpu::BufferBinding<'_> {
        wgpu::BufferBinding { buffer: &self.inner, offset: 0, size: Some(Params::SIZE) }
    }

    /// All of it, as commands other than kernels see it.
    pub(super) fn whole(&self) -> &wgpu::Buffer {
        &self.inner
    }

    /// Writes `data` at the start, before the next submission.
    pub(super) fn write<T: Pod>(&self, device: &Device, data: &[T]) {
        let bytes = bytemuck::cast_slice(data);
        device.queue.write_buffer(&self.inner, 0, bytes);
    }

    /// Sets the buffer to 0 when `encoder` runs.
    pub(super) fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.inner, 0, None);
    }

    /// The first `count` numbers, once all work submitted so far is done.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn read<T: Pod>(&self, device: &Device, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        let mut staging = self.pool.take(device, Use::Readback, bytes);
        // Until it is unmapped again, nobody else can use it.
        staging.reusable = false;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.inner, 0, &staging.inner, 0, bytes);
        device.submit(encoder.finish())?;
        let (send, mapped) = mpsc::channel();
        staging.inner.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
            // The receiver is gone only if the wait failed, which is reported by itself.
            let _ = send.send(result);
        });
        device.wait(None)?;
        let failed = |text: String| {
            device.failed(Fault::Validation, &format!("cannot read results: {text}"))
        };
        match mapped.recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(failed(e.to_string())),
            Err(e) => return Err(failed(e.to_string())),
        }
        let view = staging.inner.get_mapped_range(0..bytes);
        let numbers =
            view.map(|view| bytemuck::pod_collect_to_vec(&view)).map_err(|e| failed(e.to_string()));
        staging.inner.unmap();
        staging.reusable = true;
        numbers
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
