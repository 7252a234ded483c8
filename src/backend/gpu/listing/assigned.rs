//! Which cards a scheduler lent to this process, as the systems of their makers say it.
//!
//! `CUDA_VISIBLE_DEVICES`, `ROCR_VISIBLE_DEVICES` and `HIP_VISIBLE_DEVICES` are read by CUDA and ROCm
//! alone: Vulkan lists every card all the same. Here is what translates them.

use std::path::Path;

use super::drivers::names;
use super::pci::PciAddress;
use crate::files::{CONFIG_BYTES, read_text};

/// A card as its maker's system names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Named {
    pub(super) pci: PciAddress,
    /// As `GPU-` and digits; empty where the system does not tell.
    pub(super) uuid: String,
}

/// What the environment asks for, and what translates it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Assigned {
    /// `CUDA_VISIBLE_DEVICES`.
    pub(super) cuda: Option<String>,
    /// `CUDA_DEVICE_ORDER`.
    pub(super) cuda_order: Option<String>,
    /// `ROCR_VISIBLE_DEVICES`.
    pub(super) rocr: Option<String>,
    /// `HIP_VISIBLE_DEVICES`, whose numbers count what `rocr` left.
    pub(super) hip: Option<String>,
    /// NVIDIA's cards, in no order.
    pub(super) nvidia: Vec<Named>,
    /// AMD's cards, in the order of their system.
    pub(super) amd: Vec<Named>,
}

impl Assigned {
    /// What this process was given, with the files of the system below `root`.
    pub(super) fn of_process(root: &Path) -> Self {
        let variable = |name: &str| std::env::var(name).ok();
        Self {
            cuda: variable("CUDA_VISIBLE_DEVICES"),
            cuda_order: variable("CUDA_DEVICE_ORDER"),
            rocr: variable("ROCR_VISIBLE_DEVICES"),
            hip: variable("HIP_VISIBLE_DEVICES"),
            nvidia: nvidia(&root.join("proc/driver/nvidia/gpus")),
            amd: amd(&root.join("sys/class/kfd/kfd/topology/nodes")),
        }
    }
}

/// The cards that NVIDIA's driver has a folder of, with a file `information` each.
fn nvidia(folder: &Path) -> Vec<Named> {
    let card = |name: String| {
        let pci = PciAddress::read(&name)?;
        let text = read_text(&folder.join(name).join("information"), CONFIG_BYTES);
        let uuid = text.ok().and_then(|text| value(&text, "GPU UUID:").map(str::to_owned));
        Some(Named { pci, uuid: uuid.unwrap_or_default() })
    };
    names(folder).into_iter().filter_map(card).collect()
}

/// The nodes of AMD's topology that compute, in its order.
fn amd(folder: &Path) -> Vec<Named> {
    let mut nodes: Vec<u32> = names(folder).iter().filter_map(|name| name.parse().ok()).collect();
    nodes.sort_unstable();
    let node = |node: u32| {
        let path = folder.join(node.to_string()).join("properties");
        let text = read_text(&path, CONFIG_BYTES).ok()?;
        let number = |key: &str| value(&text, key)?.parse::<u64>().ok();
        // Processors are nodes too.
        if number("simd_count ")? == 0 {
            return None;
        }
        let location = u16::try_from(number("location_id ")?).ok()?;
        let domain = u32::try_from(number("domain ").unwrap_or(0)).ok()?;
        let uuid = number("unique_id ").map_or_else(String::new, |id| format!("GPU-{id:016x}"));
        Some(Named { pci: PciAddress::of_location(domain, location), uuid })
    };
    nodes.into_iter().filter_map(node).collect()
}

/// What follows `key` in a line that begins with it.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines().find_map(|line| line.strip_prefix(key)).map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_are_read_as_the_systems_write_them() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write(
            "proc/driver/nvidia/gpus/0000:41:00.0/information",
            "Model: \t\t NVIDIA H100\nIRQ:   \t\t 80\nGPU UUID: \t GPU-8932f937-d72c\nBus Location: \t 0000:41:00.0\n",
        );
        let node = |number: u32, simds: u32, location: u32| {
            write(
                &format!("sys/class/kfd/kfd/topology/nodes/{number}/properties"),
                &format!(
                    "cpu_cores_count 0\nsimd_count {simds}\nlocation_id {location}\ndomain 0\nunique_id 171\n"
                ),
            );
        };
        node(0, 0, 0);
        node(10, 304, 0xc300);
        node(2, 304, 0x0300);
        let assigned = Assigned::of_process(root.path());
        let card = |pci: &str, uuid: &str| Named {
            pci: PciAddress::parse(pci).unwrap(),
            uuid: uuid.to_owned(),
        };
        assert_eq!(assigned.nvidia, [card("41:00.0", "GPU-8932f937-d72c")]);
        let uuid = "GPU-00000000000000ab";
        assert_eq!(assigned.amd, [card("03:00.0", uuid), card("c3:00.0", uuid)]);
    }
}
