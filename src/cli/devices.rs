//! Who runs the work: listing the devices, and opening the one that was asked for.

use serde::Serialize;

use super::args::{BackendName, Global};
use super::{Outcome, report};
use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{Adapter, AdapterKind, Choice, Gpu, adapters};
use crate::error::{Error, Result};

/// Opens the backend that the flags ask for.
///
/// # Errors
/// [`Error::Device`] if there is none of that name or kind.
pub(super) fn open(global: &Global) -> Result<Backend> {
    if let Some(name) = &global.device {
        if global.backend == BackendName::Cpu {
            let problem = "names a GPU adapter; leave it out, or leave out --backend cpu";
            return Err(Error::invalid(format!("--device {name}"), problem));
        }
        return Gpu::open(&Choice::Named(name.clone())).map(Backend::Gpu);
    }
    match global.backend {
        BackendName::Cpu => cpu(global),
        BackendName::Gpu => Gpu::open(&Choice::Any).map(Backend::Gpu),
        BackendName::Auto if adapters().iter().any(is_hardware) => {
            Gpu::open(&Choice::Hardware).map(Backend::Gpu)
        }
        BackendName::Auto => cpu(global),
    }
}

/// Opens every backend that the flags ask for: with `auto` the CPU, and a hardware adapter if there
/// is one; else the one that [`open`] takes.
///
/// # Errors
/// [`Error::Device`] if there is none of that name or kind.
pub(super) fn all(global: &Global) -> Result<Vec<Backend>> {
    if global.backend != BackendName::Auto || global.device.is_some() {
        return Ok(vec![open(global)?]);
    }
    let mut all = vec![cpu(global)?];
    if let found @ Backend::Gpu(_) = open(global)? {
        all.push(found);
    }
    Ok(all)
}

/// The CPU with the threads asked for.
pub(super) fn cpu(global: &Global) -> Result<Backend> {
    Cpu::new(global.threads.map(usize::from)).map(Backend::Cpu)
}

/// Threads that run the rollouts of `backend`, or that feed it.
pub(super) fn threads(global: &Global) -> usize {
    let available = || std::thread::available_parallelism().map_or(1, usize::from);
    global.threads.map_or_else(available, usize::from)
}

/// Whether `adapter` is a GPU and not a program.
fn is_hardware(adapter: &Adapter) -> bool {
    adapter.kind != AdapterKind::Software
}

/// What `devices --json` prints.
#[derive(Serialize)]
struct Listing {
    cpu: String,
    adapters: Vec<Adapter>,
    /// What `--backend auto` takes.
    auto: String,
}

/// Lists the processor and the adapters, and which one `--backend auto` takes.
pub(super) fn list(global: &Global) -> Result<Outcome> {
    let adapters = adapters();
    let count = threads(global);
    let plural = if count == 1 { "" } else { "s" };
    let cpu = format!("{}, {count} thread{plural}", cpu(global)?.device());
    let chosen = adapters.iter().find(|adapter| is_hardware(adapter));
    let auto = chosen.map_or("cpu".to_owned(), |adapter| adapter.name.clone());
    let listing = Listing { cpu, adapters, auto };
    report(global, &listing, || {
        let mut text = format!("cpu  {}\n", listing.cpu);
        for adapter in &listing.adapters {
            text += &format!("gpu  {adapter}\n");
        }
        if listing.adapters.is_empty() {
            text += "gpu  none found (needs a Vulkan, Metal or DX12 driver; on Debian the package \
                     mesa-vulkan-drivers has a software one)\n";
        }
        text + &format!("--backend auto takes: {}\n", listing.auto)
    })?;
    Ok(Outcome::Done)
}
