//! Pipelines: one per kernel text, built when first needed.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::cache::PipelineCache;
use super::compose::{Access, Kernel, Slot};
use super::device::Device;
use super::params::Params;
use super::traffic::Count;
use crate::error::Result;

/// Changes the text of a kernel before it is compiled.
pub(super) type Edit = Arc<dyn Fn(&str) -> String + Send + Sync>;

/// A kernel before it is compiled.
pub(super) struct Composed {
    pub(super) kernel: Kernel,
    pub(super) bindings: Vec<(Slot, Access)>,
    /// Columns of a workgroup.
    pub(super) columns: u32,
    pub(super) text: String,
}

/// A compiled kernel and what it binds.
pub(super) struct Pipeline {
    kernel: Kernel,
    columns: u32,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<(Slot, Access)>,
    pipeline: wgpu::ComputePipeline,
}

/// Pipelines by kernel and text. The text holds the physics and the network's activations; the
/// network's widths are parameters.
#[derive(Default)]
pub(super) struct Pipelines {
    edit: Option<Edit>,
    cache: Option<PipelineCache>,
    built: Mutex<HashMap<(Kernel, String), Arc<Pipeline>>>,
}

impl Pipelines {
    /// Pipelines that start from those of earlier runs.
    pub(super) fn new(device: &Device) -> Self {
        Self { cache: PipelineCache::open(&device.device), ..Self::default() }
    }

    /// Pipelines whose texts go through `edit` first, and which leave nothing behind.
    pub(super) fn edited(edit: Edit) -> Self {
        Self { edit: Some(edit), ..Self::default() }
    }

    /// The pipeline of a kernel, from the cache or built now.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn pipeline(&self, device: &Device, composed: Composed) -> Result<Arc<Pipeline>> {
        let Composed { kernel, bindings, columns, text } = composed;
        let text = match &self.edit {
            Some(edit) => edit(&text),
            None => text,
        };
        let key = (kernel, text);
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = built.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        device.counters.add(Count::Pipeline);
        let module = self.module(device, kernel, &key.1);
        let cache = self.cache.as_ref().map(PipelineCache::handle);
        let built_now = Pipeline::new(device, kernel, bindings, &module, cache);
        let pipeline = Arc::new(Pipeline { columns, ..built_now });
        device.check()?;
        built.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// Compiles `text`; with bounds checks if it was edited.
    fn module(&self, device: &Device, kernel: Kernel, text: &str) -> wgpu::ShaderModule {
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(kernel.entry()),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        };
        if self.edit.is_some() {
            return device.device.create_shader_module(descriptor);
        }
        #[allow(unsafe_code, reason = "unchecked modules compile two to five times faster")]
        // SAFETY: columns are tested against `columns` or padded to the stride, steps are bounded
        // by the length of the schedule or of the plans of the problems, and `inputs`, `plan` and
        // `mppi_plan` size every buffer for that stride, that length and those problems; workgroup
        // memory has the vectors of the widest layer, and `limits` sizes its buffers for its
        // threads; the cell of a map is bounded by the number of its cells, as an integer; a window
        // of blocks is as long as a segment, whose dispatches alone are narrowed, and counts have a
        // place for each workgroup; the recorded physics has neither loops nor indices that are not
        // constant, and every loop of the hand-written kernels ends; the loops of a generated network
        // run over its layers and their inputs, its trajectories divide the padding of columns, its
        // threads beyond a layer read its last neurons and write none, and slices end with the layer,
        // behind the last of which comes the first slice of the first.
        unsafe {
            let checks = wgpu::ShaderRuntimeChecks::unchecked();
            device.device.create_shader_module_trusted(descriptor, checks)
        }
    }
}

impl Pipeline {
    fn new(
        device: &Device,
        kernel: Kernel,
        bindings: Vec<(Slot, Access)>,
        module: &wgpu::ShaderModule,
        cache: Option<&wgpu::PipelineCache>,
    ) -> Self {
        let entries: Vec<_> = bindings.iter().map(layout_entry).collect();
        let label = Some(kernel.entry());
        let device = &device.device;
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &entries,
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module,
            entry_point: Some(kernel.entry()),
            compilation_options: wgpu::PipelineCompilationOptions {
                // Every kernel writes workgroup memory before it reads it.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache,
        });
        Self { kernel, columns: kernel.workgroup(), layout, bindings, pipeline }
    }

    /// Binds the buffer that `buffer` names for each slot.
    pub(super) fn bind<'a>(
        self: &Arc<Self>,
        device: &Device,
        buffer: impl Fn(Slot) -> wgpu::BufferBinding<'a>,
    ) -> Bound {
        let entry = |&(slot, _): &(Slot, Access)| wgpu::BindGroupEntry {
            binding: slot as u32,
            resource: wgpu::BindingResource::Buffer(buffer(slot)),
        };
        let entries: Vec<_> = self.bindings.iter().map(entry).collect();
        device.counters.add(Count::Group);
        let group = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.kernel.entry()),
            layout: &self.layout,
            entries: &entries,
        });
        Bound { pipeline: Arc::clone(self), group }
    }
}

/// A pipeline with its buffers.
pub(super) struct Bound {
    pipeline: Arc<Pipeline>,
    group: wgpu::BindGroup,
}

impl Bound {
    /// Name of the kernel's entry point.
    pub(super) fn kernel(&self) -> &'static str {
        self.pipeline.kernel.entry()
    }

    /// Columns of a workgroup.
    pub(super) fn columns(&self) -> u32 {
        self.pipeline.columns
    }

    /// Chooses the kernel, with the parameters at `offset`.
    pub(super) fn choose(&self, pass: &mut wgpu::ComputePass<'_>, offset: u32) {
        pass.set_pipeline(&self.pipeline.pipeline);
        pass.set_bind_group(0, &self.group, &[offset]);
    }
}

/// The layout of one binding.
fn layout_entry(&(slot, access): &(Slot, Access)) -> wgpu::BindGroupLayoutEntry {
    let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
    let block = access == Access::Uniform;
    let written = access == Access::Blocks;
    wgpu::BindGroupLayoutEntry {
        binding: slot as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match access {
                Access::Uniform | Access::Constant => wgpu::BufferBindingType::Uniform,
                Access::Read => storage(true),
                Access::ReadWrite | Access::Blocks => storage(false),
            },
            has_dynamic_offset: block || written,
            min_binding_size: block.then_some(Params::SIZE),
        },
        count: None,
    }
}
