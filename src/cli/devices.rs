//! Who runs the work: listing the devices, and opening the one that was asked for.

use std::io::Write;

use serde::Serialize;

use super::options::{BackendName, Global};
use super::{Outcome, document, report};
use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{Adapter, Choice, Gpu, Listing, has_hardware, listing};
use crate::error::{Error, Result};

/// Opens the backend that the flags ask for; with `--fallback`, the CPU where no adapter opens, and
/// behind it where one does.
///
/// # Errors
/// [`Error::Device`] if there is none of that name or kind.
pub(crate) fn open(global: &Global) -> Result<Backend> {
    let Some(choice) = choice(global)? else { return cpu(global).map(Backend::Cpu) };
    match Gpu::open(&choice) {
        Ok(gpu) if global.common.fallback => Ok(Backend::Gpu(gpu.with_fallback(cpu(global)?))),
        Ok(gpu) => Ok(Backend::Gpu(gpu)),
        Err(Error::Device(problem)) if global.common.fallback => {
            Ok(Backend::Cpu(cpu(global)?.in_place_of_adapter(problem)))
        }
        Err(error) => Err(error),
    }
}

/// The adapter that the flags ask for; `None` for the CPU.
fn choice(global: &Global) -> Result<Option<Choice>> {
    if let Some(name) = &global.common.device {
        if global.common.backend == BackendName::Cpu {
            let problem = "names a GPU adapter; leave it out, or leave out --backend cpu";
            return Err(Error::invalid(format!("--device {name}"), problem));
        }
        return Choice::parse(name).map(Some);
    }
    Ok(match global.common.backend {
        BackendName::Gpu => Some(Choice::Any),
        BackendName::Auto if has_hardware() => Some(Choice::Hardware),
        BackendName::Auto | BackendName::Cpu => None,
    })
}

/// Says on standard error what failed on the adapter and was worked around.
pub(crate) fn note_events(global: &Global, backend: &Backend) {
    if global.common.quiet {
        return;
    }
    for event in backend.events() {
        // Nobody reads what a closed pipe does not take.
        let _ = writeln!(std::io::stderr(), "note: {event}");
    }
}

/// Opens every backend that the flags ask for: with `auto` the CPU, and a hardware adapter if there
/// is one; else the one that [`open`] takes.
///
/// # Errors
/// [`Error::Device`] if there is none of that name or kind.
pub(crate) fn all(global: &Global) -> Result<Vec<Backend>> {
    if global.common.backend != BackendName::Auto || global.common.device.is_some() {
        return Ok(vec![open(global)?]);
    }
    let mut all = vec![cpu(global).map(Backend::Cpu)?];
    if let found @ Backend::Gpu(_) = open(global)? {
        all.push(found);
    }
    Ok(all)
}

/// The CPU with the threads asked for.
pub(crate) fn cpu(global: &Global) -> Result<Cpu> {
    Cpu::new(global.common.threads.map(usize::from))
}

/// Threads that run the rollouts of `backend`, or that feed it.
pub(crate) fn threads(global: &Global) -> usize {
    let available = || std::thread::available_parallelism().map_or(1, usize::from);
    global.common.threads.map_or_else(available, usize::from)
}

/// What `devices --json` prints.
#[derive(Serialize)]
struct Devices {
    cpu: String,
    /// In the order that `--device` counts them in.
    adapters: Vec<Adapter>,
    /// What `--backend auto` takes.
    auto: String,
    /// What the environment hides.
    notes: Vec<String>,
    /// Why cards that are there are not listed.
    diagnosis: Vec<String>,
}

/// Lists the processor and the adapters, and which one `--backend auto` takes.
pub(crate) fn list(global: &Global) -> Result<Outcome> {
    let Listing { adapters, notes, diagnosis } = listing();
    let count = threads(global);
    let plural = if count == 1 { "" } else { "s" };
    let cpu = format!("{}, {count} thread{plural}", cpu(global)?.device());
    let chosen = adapters.iter().find(|adapter| adapter.is_hardware());
    let auto = chosen.map_or("cpu".to_owned(), |adapter| adapter.name.clone());
    let devices = Devices { cpu, adapters, auto, notes, diagnosis };
    report(global, &document(&devices), || devices.in_words())?;
    Ok(Outcome::Done)
}

impl Devices {
    /// A line for each device, then what is to be said of them.
    fn in_words(&self) -> String {
        let mut text = format!("cpu    {}\n", self.cpu);
        for (place, adapter) in self.adapters.iter().enumerate() {
            let pci = adapter.pci.map_or_else(String::new, |pci| format!(", pci:{pci}"));
            text += &format!("gpu {place:<2} {adapter}{pci}\n");
        }
        if self.adapters.is_empty() {
            text += "gpu    none found (needs a Vulkan, Metal or DX12 driver; on Debian the package \
                     mesa-vulkan-drivers has a software one)\n";
        }
        for line in self.notes.iter().chain(&self.diagnosis) {
            text += &format!("note: {line}\n");
        }
        text + &format!("--backend auto takes: {}\n", self.auto)
    }
}
