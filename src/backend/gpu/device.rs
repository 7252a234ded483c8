//! Adapters: listing, choosing and opening them, and catching what fails on them.

use std::fmt;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Duration;

use super::fault::{Failure, Faults, Injection, Injector};
use super::traffic::{Count, Counters};
use crate::error::{Error, Fault, Result};

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
    found(&instance()).into_iter().map(|(adapter, _)| adapter).collect()
}

/// What is asked for where the adapter has it; nothing depends on it.
const WELCOME_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::PIPELINE_CACHE);

/// Longest wait for work that was submitted. A submission is kept far below it, and below the 2 s
/// after which some systems reset a device (`plan.rs`): what takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(60);

/// An opened device and its queue, as one call sees them.
#[derive(Clone)]
pub(super) struct Device {
    pub(super) adapter: Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) counters: Arc<Counters>,
    faults: Arc<Faults>,
    /// Failures of earlier calls.
    seen: usize,
    injector: Arc<Injector>,
    patience: Duration,
}

impl Device {
    /// Opens the adapter that `choice` names.
    pub(super) fn open(choice: &Choice) -> Result<Self> {
        let all = found(&instance());
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
        Self::request(adapter, &handle)
    }

    /// Opens the same adapter again.
    ///
    /// # Errors
    /// [`Error::Device`] if it is gone or does not open.
    pub(super) fn reopened(&self) -> Result<Self> {
        let handle = found_again(&instance(), &self.adapter)?;
        Ok(Self {
            injector: Arc::clone(&self.injector),
            counters: Arc::clone(&self.counters),
            patience: self.patience,
            ..Self::request(self.adapter.clone(), &handle)?
        })
    }

    fn request(adapter: Adapter, handle: &wgpu::Adapter) -> Result<Self> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("reachcast"),
            required_features: handle.features() & WELCOME_FEATURES,
            required_limits: handle.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Device(format!("{adapter} does not open: {e}")))?;
        let faults = Arc::new(Faults::default());
        let seen = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            let fault = match &e {
                wgpu::Error::OutOfMemory { .. } => Fault::OutOfMemory,
                wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => Fault::Validation,
            };
            seen.note(fault, e.to_string());
        }));
        let seen = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, text| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                seen.note(Fault::Lost, text);
            }
        });
        let (injector, counters, patience) = (Arc::default(), Arc::default(), PATIENCE);
        Ok(Self { adapter, device, queue, counters, faults, seen: 0, injector, patience })
    }

    /// The same device, whose submissions fail as `asked`.
    pub(super) fn failing(self, asked: Vec<Injection>) -> Self {
        Self { injector: Arc::new(Injector::new(asked)), ..self }
    }

    /// The same device, where work takes too long beyond `patience`.
    pub(super) fn waiting(self, patience: Duration) -> Self {
        Self { patience, ..self }
    }

    /// The same device for a call that begins now.
    pub(super) fn for_call(&self) -> Self {
        Self { seen: self.faults.count(), ..self.clone() }
    }

    /// Submissions so far, also those before the device was opened again.
    pub(super) fn submissions(&self) -> u64 {
        self.injector.submissions()
    }

    /// Starts the work of `commands`.
    ///
    /// # Errors
    /// [`Error::DeviceFailed`] where a test asks for it.
    pub(super) fn submit(&self, commands: wgpu::CommandBuffer) -> Result<wgpu::SubmissionIndex> {
        self.counters.add(Count::Submission);
        if let Some(fault) = self.injector.next() {
            self.inject(fault);
            self.check()?;
        }
        Ok(self.counters.in_driver(|| self.queue.submit([commands])))
    }

    /// Fails as `fault`: by the driver itself where it can be brought to it.
    fn inject(&self, fault: Fault) {
        match fault {
            // One byte more than any buffer may have.
            Fault::Validation => drop(self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("injected"),
                size: self.adapter.max_buffer_bytes + 1,
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })),
            Fault::Lost => {
                self.device.destroy();
                self.faults.note(fault, "injected".to_owned());
            }
            _ => self.faults.note(fault, "injected".to_owned()),
        }
    }

    /// Whether the call is free of failures so far.
    ///
    /// # Errors
    /// [`Error::DeviceFailed`] with what failed.
    pub(super) fn check(&self) -> Result<()> {
        match self.faults.since(self.seen) {
            Some(Failure { fault, problem }) => Err(self.failed(fault, &problem)),
            None => Ok(()),
        }
    }

    /// Waits for `submission`, or for everything.
    ///
    /// # Errors
    /// [`Error::DeviceFailed`], also for failures of earlier work of the call.
    pub(super) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<()> {
        self.counters.add(Count::Wait);
        let polled = contained(|| {
            let timeout = Some(self.patience);
            let wait = wgpu::PollType::Wait { submission_index: submission, timeout };
            self.counters.in_driver(|| self.device.poll(wait))
        });
        self.check()?;
        match polled {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(wgpu::PollError::Timeout)) => {
                let limit = self.patience.as_secs_f64();
                Err(self.failed(Fault::Timeout, &format!("work did not end within {limit} s")))
            }
            Ok(Err(e)) => Err(self.failed(Fault::Validation, &e.to_string())),
            Err(problem) => Err(self.failed(Fault::Lost, &problem)),
        }
    }

    /// An [`Error::DeviceFailed`] that names the adapter.
    pub(super) fn failed(&self, fault: Fault, problem: &str) -> Error {
        Error::DeviceFailed { fault, problem: format!("{}: {problem}", self.adapter.name) }
    }
}

/// What `work` returns, or what it panics with: wgpu does where a device is lost while it waits.
pub(crate) fn contained<T>(work: impl FnOnce() -> T) -> std::result::Result<T, String> {
    // The device is given up after that, so nobody sees what the panic left behind.
    std::panic::catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        text.unwrap_or("the driver gave no reason").to_owned()
    })
}

/// Access to the drivers of this machine.
pub(super) fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    // No validation layers and no debug messages: the listing stays silent.
    descriptor.flags = wgpu::InstanceFlags::empty();
    descriptor.backends = wgpu::Backends::PRIMARY;
    wgpu::Instance::new(descriptor)
}

/// The handle of `adapter`, listed before.
///
/// # Errors
/// [`Error::Device`] if it is gone.
pub(super) fn found_again(instance: &wgpu::Instance, adapter: &Adapter) -> Result<wgpu::Adapter> {
    let same = found(instance).into_iter().find(|(found, _)| found == adapter);
    let gone = || Error::Device(format!("{adapter} is not there any more"));
    same.map(|(_, handle)| handle).ok_or_else(gone)
}

/// Adapters that can run compute kernels, best first.
fn found(instance: &wgpu::Instance) -> Vec<(Adapter, wgpu::Adapter)> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_while_waiting_is_contained() {
        let lost = contained(|| -> () { panic!("Error in {}: lost", "Device::poll") });
        assert_eq!(lost, Err("Error in Device::poll: lost".to_owned()));
        assert_eq!(contained(|| 1), Ok(1));
    }
}
