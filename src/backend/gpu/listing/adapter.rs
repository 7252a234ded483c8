//! An adapter in words and figures.

use std::fmt;

use super::pci::PciAddress;

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
    /// Place on the PCI bus, where the driver tells.
    pub pci: Option<PciAddress>,
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
    pub(in crate::backend::gpu) fn made_up(max_binding_bytes: u64) -> Self {
        Self {
            name: "made up".to_owned(),
            api: "none".to_owned(),
            kind: AdapterKind::Unknown,
            driver: String::new(),
            pci: None,
            max_buffer_bytes: 1 << 30,
            max_binding_bytes,
            max_workgroup_threads: 256,
            max_workgroup_bytes: 16 << 10,
        }
    }

    /// Whether it is a GPU and not a program.
    pub fn is_hardware(&self) -> bool {
        self.kind != AdapterKind::Software
    }

    pub(super) fn new(adapter: &wgpu::Adapter) -> Self {
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
            pci: PciAddress::read(&info.device_pci_bus_id),
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
