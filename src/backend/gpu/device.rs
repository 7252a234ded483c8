//! Adapters: listing, choosing and opening them, and catching what fails on them.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};

/// What an adapter is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdapterKind {
    /// A graphics card with memory of its own.
    Discrete,
    /// A graphics unit that shares the host's memory.
    Integrated,
    /// A graphics unit lent to a virtual machine.
    Virtual,
    /// A GPU interface run by the host's processor.
    Software,
    /// The driver does not say.
    Unknown,
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Software => "software",
            Self::Unknown => "unknown",
        })
    }
}

/// An adapter in words and figures.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Adapter {
    /// Name, as the driver gives it.
    pub name: String,
    /// Interface: vulkan, metal or dx12.
    pub api: String,
    /// What it is made of.
    pub kind: AdapterKind,
    /// Driver and its version.
    pub driver: String,
    /// Largest buffer, bytes.
    pub max_buffer_bytes: u64,
    /// Largest part of a buffer that a kernel can see, bytes.
    pub max_binding_bytes: u64,
    /// Largest number of threads of a workgroup.
    pub max_workgroup_threads: u32,
    /// Largest memory that the threads of a workgroup share, bytes.
    pub max_workgroup_bytes: u32,
}

impl Adapter {
    /// One that is not there, whose kernels see `max_binding_bytes` of a buffer.
    #[cfg(test)]
    pub(super) fn made_up(max_binding_bytes: u64) -> Self {
        Self {
            name: "made up".to_owned(),
            api: "none".to_owned(),
            kind: AdapterKind::Unknown,
            driver: String::new(),
            max_buffer_bytes: 1 << 30,
            max_binding_bytes,
            max_workgroup_threads: 256,
            max_workgroup_bytes: 16 << 10,
        }
    }

    fn new(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let limits = adapter.limits();
        let driver = [info.driver.as_str(), info.driver_info.as_str()];
        Self {
            name: info.name,
            api: info.backend.to_str().to_owned(),
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
                wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
                wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
                wgpu::DeviceType::Cpu => AdapterKind::Software,
                wgpu::DeviceType::Other => AdapterKind::Unknown,
            },
            driver: driver.join(" ").trim().to_owned(),
            max_buffer_bytes: limits.max_buffer_size,
            max_binding_bytes: limits.max_storage_buffer_binding_size,
            max_workgroup_threads: limits.max_compute_invocations_per_workgroup,
            max_workgroup_bytes: limits.max_compute_workgroup_storage_size,
        }
    }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {}", self.name, self.api, self.kind)?;
        if self.driver.is_empty() { f.write_str(")") } else { write!(f, ", {})", self.driver) }
    }
}

/// Which adapter to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The best one that is not software.
    Hardware,
    /// The best one; software where there is nothing else.
    Any,
    /// The best one whose name contains this text, in any case.
    Named(String),
}

/// The adapters of this machine, best first; empty where there is no driver.
pub fn adapters() -> Vec<Adapter> {
    found().into_iter().map(|(adapter, _)| adapter).collect()
}

/// What is asked for where the adapter has it; nothing depends on it.
const WELCOME_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::PIPELINE_CACHE);

/// An opened device and its queue.
pub(super) struct Device {
    pub(super) adapter: Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    faults: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the adapter that `choice` names.
    pub(super) fn open(choice: &Choice) -> Result<Self> {
        let all = found();
        let names: Vec<String> = all.iter().map(|(adapter, _)| adapter.to_string()).collect();
        let fits = |adapter: &Adapter| match choice {
            Choice::Hardware => adapter.kind != AdapterKind::Software,
            Choice::Any => true,
            Choice::Named(part) => adapter.name.to_lowercase().contains(&part.to_lowercase()),
        };
        let chosen = all.into_iter().find(|(adapter, _)| fits(adapter));
        let Some((adapter, handle)) = chosen else {
            return Err(Error::Device(nothing_fits(choice, &names)));
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("reachcast"),
            required_features: handle.features() & WELCOME_FEATURES,
            required_limits: handle.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Device(format!("{adapter} does not open: {e}")))?;
        let faults = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| note(&seen, e.to_string())));
        let seen = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, text| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&seen, format!("device lost: {text}"));
            }
        });
        Ok(Self { adapter, device, queue, faults })
    }

    /// The first failure since the last call, if any.
    ///
    /// # Errors
    /// [`Error::DeviceFailed`] with its text.
    pub(super) fn check(&self) -> Result<()> {
        let fault = self.faults.lock().unwrap_or_else(PoisonError::into_inner).take();
        fault.map_or(Ok(()), |text| Err(self.failed(&text)))
    }

    /// Waits for `submission`, or for everything.
    ///
    /// # Errors
    /// [`Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<()> {
        let polled =
            self.device.poll(wgpu::PollType::Wait { submission_index: submission, timeout: None });
        self.check()?;
        polled.map(drop).map_err(|e| self.failed(&e.to_string()))
    }

    /// An [`Error::DeviceFailed`] that names the adapter.
    pub(super) fn failed(&self, text: &str) -> Error {
        Error::DeviceFailed(format!("{}: {text}", self.adapter.name))
    }
}

/// Keeps the first failure: later ones follow from it.
fn note(faults: &Mutex<Option<String>>, text: String) {
    faults.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(text);
}

/// Adapters that can run compute kernels, best first.
fn found() -> Vec<(Adapter, wgpu::Adapter)> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    // No validation layers and no debug messages: the listing stays silent.
    descriptor.flags = wgpu::InstanceFlags::empty();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let instance = wgpu::Instance::new(descriptor);
    let handles = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let mut all: Vec<_> = handles
        .into_iter()
        .filter(|handle| {
            let flags = handle.get_downlevel_capabilities().flags;
            flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
        })
        .map(|handle| (Adapter::new(&handle), handle))
        .collect();
    // A stable sort: of equal kinds, the driver's order.
    all.sort_by_key(|(adapter, _)| match adapter.kind {
        AdapterKind::Discrete => 0,
        AdapterKind::Integrated => 1,
        AdapterKind::Virtual => 2,
        AdapterKind::Unknown => 3,
        AdapterKind::Software => 4,
    });
    all
}

/// Why no adapter was opened, and what to do.
fn nothing_fits(choice: &Choice, found: &[String]) -> String {
    if found.is_empty() {
        return "no GPU adapter found; install a Vulkan driver (Metal or DX12 on their systems), \
                or use the native CPU backend"
            .to_owned();
    }
    let found = found.join("; ");
    match choice {
        Choice::Named(part) => format!(
            "no adapter's name contains `{part}`; found: {found}; \
             name one of these, or use the native CPU backend"
        ),
        Choice::Hardware | Choice::Any => format!(
            "no hardware GPU adapter; found: {found}; name it to run on it all the same, \
             or use the native CPU backend, which is faster than software adapters"
        ),
    }
}
