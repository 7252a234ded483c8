//! Adapters: opening them, and catching what fails on them.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Duration;

use super::fault::{Failure, Faults, Injection, Injector};
use super::listing::{Adapter, Choice, chosen, found_again, instance};
use super::traffic::{Count, Counters};
use crate::error::{Error, Fault, Result};

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
    ///
    /// # Errors
    /// [`Error::Device`] if there is none or it does not open.
    pub(super) fn open(choice: &Choice) -> Result<Self> {
        let (adapter, handle) = chosen(choice)?;
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
