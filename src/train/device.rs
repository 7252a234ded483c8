//! Where tensors lie, the processor or an adapter, and how numbers get there and back.

use burn_autodiff::Autodiff;
use burn_autodiff::ops::NodeGuard;
use burn_backend::{Backend as Tensors, read_sync};
use burn_dispatch::{DispatchKindConversion, DispatchTensor, backends};
use burn_tensor::{Tensor, TensorData};

use crate::backend::Backend;
use crate::backend::gpu::Gpu;
use crate::error::Result;

/// The library's tensors on the processor.
#[expect(deprecated, reason = "its successor sums products in another order: other networks")]
pub(super) type Host = backends::NdArray;
/// The same on an adapter.
#[cfg(feature = "train-gpu")]
pub(super) type Remote = backends::Cube;

/// Where tensors lie, and so where what follows from them is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Device(burn_tensor::Device);

impl Device {
    /// The processor: one thread, so that sums have one order.
    pub fn cpu() -> Self {
        #[expect(deprecated, reason = "see `Host`")]
        Self(burn_tensor::Device::ndarray().autodiff())
    }

    /// The adapter of `gpu`, opened once more: the library takes over what fails on its device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if it does not open, or is not what the library can work with.
    #[cfg(feature = "train-gpu")]
    pub fn gpu(gpu: &Gpu) -> Result<Self> {
        let lent = gpu.lend()?;
        let setup = burn_tensor::wgpu::WgpuSetup {
            backend: lent.adapter.get_info().backend,
            instance: lent.instance,
            adapter: lent.adapter,
            device: lent.device,
            queue: lent.queue,
        };
        let device = burn_tensor::Device::wgpu_options().setup(setup).init();
        let unfit = |problem| crate::Error::Device(format!("{}: {problem}", gpu.device()));
        device.map(|device| Self(device.autodiff())).map_err(unfit)
    }

    /// No adapter is there for a program without the tensors.
    ///
    /// # Errors
    /// [`crate::Error::Device`], always.
    #[cfg(not(feature = "train-gpu"))]
    pub fn gpu(_: &Gpu) -> Result<Self> {
        let problem = "this program trains on the CPU alone; take --backend cpu, or build it with \
                       `cargo build --release --features train-gpu`";
        Err(crate::Error::Device(problem.to_owned()))
    }

    /// Where `backend` is.
    ///
    /// # Errors
    /// Those of [`Device::gpu`].
    pub fn of(backend: &Backend) -> Result<Self> {
        match backend {
            Backend::Cpu(_) => Ok(Self::cpu()),
            Backend::Gpu(gpu) => Self::gpu(gpu),
        }
    }

    /// What `work` comes to. The library panics where an adapter fails: that is an error here.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], and those of `work`.
    pub fn contained<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        if *self == Self::cpu() {
            return work();
        }
        crate::backend::gpu::contained(work).unwrap_or_else(|problem| {
            Err(crate::Error::DeviceFailed { fault: crate::error::Fault::Lost, problem })
        })
    }

    /// A tensor from its numbers, row by row.
    pub fn tensor(&self, values: Vec<f32>, shape: [usize; 2]) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values, shape), &self.0)
    }
}

/// Whether `tensor` is on the processor.
pub(super) fn on_host(tensor: &Tensor<2>) -> bool {
    tensor.device() == Device::cpu().0
}

/// The numbers of a tensor, row by row.
///
/// # Panics
/// If its device has failed.
pub fn floats<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    numbers(tensor.into_data())
}

/// The number of a tensor that holds one.
///
/// # Panics
/// If its device has failed.
pub(super) fn number(tensor: Tensor<1>) -> f64 {
    f64::from(tensor.into_scalar::<f32>())
}

/// A tensor of the backend `B` without derivatives, and its place among those that have some.
pub(super) fn parts<B>(tensor: Tensor<2>) -> (B::FloatTensorPrimitive, NodeGuard)
where
    B: Tensors,
    DispatchTensor: DispatchKindConversion<Autodiff<B>>,
{
    let tensor = tensor.try_into_primitive::<Autodiff<B>>();
    tensor.expect("a tensor with derivatives, where it is said to be").into_parts()
}

/// A tensor of the backend `B` from its numbers, row by row.
pub(super) fn primitive<B: Tensors>(
    values: Vec<f32>,
    shape: [usize; 2],
    device: &B::Device,
) -> B::FloatTensorPrimitive {
    B::float_from_data(TensorData::new(values, shape), device)
}

/// The numbers of a tensor of the backend `B`, row by row.
///
/// # Panics
/// If its device has failed.
pub(super) fn values<B: Tensors>(tensor: B::FloatTensorPrimitive) -> Vec<f32> {
    numbers(read_sync(B::float_into_data(tensor)).expect("a device that works"))
}

/// The numbers of `data`.
fn numbers(data: TensorData) -> Vec<f32> {
    data.try_into_vec().expect("tensors are of f32")
}
