//! The adapters of this machine: listed, chosen, and why one is not there.

mod adapter;
mod assigned;
mod choice;
mod diagnosis;
mod drivers;
mod pci;
mod visible;

use std::path::Path;

pub use adapter::{Adapter, AdapterKind};
use assigned::Assigned;
pub use choice::Choice;
use diagnosis::Surroundings;
pub(super) use drivers::{layer_folders, manifest_folders, names};
pub use pci::PciAddress;
use visible::{Card, Maker, visible};

use crate::error::{Error, Result};

/// The root of the file system.
const ROOT: &str = "/";

/// The adapters of this machine, and what is to be said of them.
#[derive(Clone, Debug)]
pub struct Listing {
    /// Best first; empty where there is no driver.
    pub adapters: Vec<Adapter>,
    /// Cards that the environment hides, and words of it that cannot be followed.
    pub notes: Vec<String>,
    /// Why cards whose devices are there are not listed, and what to do; on Linux alone.
    pub diagnosis: Vec<String>,
}

/// The adapters that this process may use, best first; empty where there is no driver. Cards that
/// `CUDA_VISIBLE_DEVICES`, `HIP_VISIBLE_DEVICES` or `ROCR_VISIBLE_DEVICES` hide are left out.
pub fn adapters() -> Vec<Adapter> {
    found(&instance()).adapters()
}

/// The same with what is to be said of them.
pub fn listing() -> Listing {
    let found = found(&instance());
    let (adapters, diagnosis) = (found.adapters(), found.diagnosis());
    Listing { adapters, notes: found.notes.into_iter().chain(found.obstacle).collect(), diagnosis }
}

/// Access to the drivers of this machine.
pub(super) fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    // No validation layers and no debug messages: the listing stays silent.
    descriptor.flags = wgpu::InstanceFlags::empty();
    descriptor.backends = wgpu::Backends::PRIMARY;
    wgpu::Instance::new(descriptor)
}

/// The handle of the adapter that `choice` names.
///
/// # Errors
/// [`Error::Device`] if there is none, and where the environment says which cards may be used in words
/// that cannot be followed.
pub(super) fn chosen(choice: &Choice) -> Result<(Adapter, wgpu::Adapter)> {
    let found = found(&instance());
    if let (Some(problem), false) = (&found.obstacle, matches!(choice, Choice::Pci(_))) {
        let problem =
            format!("{problem}, or name the card by its place (--device pci:0000:01:00.0)");
        return Err(Error::Device(problem));
    }
    choice.among(&found.listed).cloned().ok_or_else(|| {
        let reasons = found.notes.iter().cloned().chain(found.diagnosis());
        let said = std::iter::once(choice.nothing_fits(&found.adapters())).chain(reasons);
        Error::Device(said.collect::<Vec<String>>().join("; "))
    })
}

/// The handle of `adapter`, listed before.
///
/// # Errors
/// [`Error::Device`] if it is gone.
pub(super) fn found_again(instance: &wgpu::Instance, adapter: &Adapter) -> Result<wgpu::Adapter> {
    let same = found(instance).listed.into_iter().find(|(found, _)| found == adapter);
    let gone = || Error::Device(format!("{adapter} is not there any more"));
    same.map(|(_, handle)| handle).ok_or_else(gone)
}

/// What the drivers list.
struct Found {
    /// Adapters that can run compute kernels and may be used, best first.
    listed: Vec<(Adapter, wgpu::Adapter)>,
    /// What the environment hides.
    notes: Vec<String>,
    /// Why it cannot be followed.
    obstacle: Option<String>,
}

impl Found {
    /// The adapters without their handles.
    fn adapters(&self) -> Vec<Adapter> {
        self.listed.iter().map(|(adapter, _)| adapter.clone()).collect()
    }

    /// Why cards whose devices are there are not listed; nothing where cards are hidden, whose drivers
    /// are there.
    fn diagnosis(&self) -> Vec<String> {
        if !self.notes.is_empty() || !cfg!(target_os = "linux") {
            return Vec::new();
        }
        let hardware = self.listed.iter().filter(|(adapter, _)| adapter.is_hardware());
        let makers: Vec<Maker> = hardware.map(|(_, handle)| maker(handle)).collect();
        Surroundings::of_process(Path::new(ROOT)).diagnosis(&makers)
    }
}

/// Adapters that can run compute kernels and that the environment leaves to this process.
fn found(instance: &wgpu::Instance) -> Found {
    let handles = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let computes = |handle: &wgpu::Adapter| {
        let flags = handle.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    };
    let all: Vec<_> = handles
        .into_iter()
        .filter(computes)
        .map(|handle| (Adapter::new(&handle), handle))
        .collect();
    let card = |(adapter, handle): &(Adapter, wgpu::Adapter)| Card {
        maker: maker(handle),
        name: adapter.name.clone(),
        pci: adapter.pci,
    };
    let cards: Vec<Card> = all.iter().map(card).collect();
    let seen = visible(&cards, &Assigned::of_process(Path::new(ROOT)));
    let mut listed: Vec<_> = seen.order.iter().map(|place| all[*place].clone()).collect();
    // A stable sort: of equal kinds, the environment's order and then the driver's.
    listed.sort_by_key(|(adapter, _)| rank(adapter.kind));
    Found { listed, notes: seen.notes, obstacle: seen.obstacle }
}

/// Who made an adapter.
fn maker(handle: &wgpu::Adapter) -> Maker {
    let info = handle.get_info();
    // A program in place of a card is nobody's to lend.
    if info.device_type == wgpu::DeviceType::Cpu { Maker::Other } else { Maker::of(info.vendor) }
}

/// The place of a kind among the others: 0 is taken first.
fn rank(kind: AdapterKind) -> u8 {
    match kind {
        AdapterKind::Discrete => 0,
        AdapterKind::Integrated => 1,
        AdapterKind::Virtual => 2,
        AdapterKind::Unknown => 3,
        AdapterKind::Software => 4,
    }
}
