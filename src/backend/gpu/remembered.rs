//! Whether this machine has a hardware adapter, asked once and remembered where the answer is no.
//!
//! Asking loads every driver, which takes longer than many a command. A machine that has an adapter
//! is asked each time, since the adapter is opened then.

use std::path::Path;

use super::cache::folder as cache_folder;
use super::listing::{Adapter, adapters, layer_folders, manifest_folders, names};
use crate::digest::sha256;
use crate::files::{CONFIG_BYTES, Staged, read_text};

/// Name of the file whose content is the key of the machine that was found to have none.
const FILE: &str = "no-hardware-adapter";
/// Names of devices in `/dev` that are graphics, as they begin.
const GRAPHICS: [&str; 6] = ["dri", "nvidia", "kfd", "dxg", "mali", "card"];
/// Variables that change which cards are found, as they begin.
const VARIABLES: [&str; 9] = [
    "VK_",
    "VULKAN_",
    "WGPU_",
    "MESA_",
    "LD_LIBRARY_PATH",
    "CUDA_",
    "ROCR_VISIBLE",
    "HIP_VISIBLE",
    "XDG_DATA",
];

/// Whether this machine has an adapter that is a GPU and not a program.
///
/// That there is none is remembered in the user's folder for caches, until something changes that could
/// change the answer.
pub fn has_hardware() -> bool {
    let ask = || adapters().iter().any(Adapter::is_hardware);
    match (key(), cache_folder()) {
        (Some(key), Some(folder)) => remembered(&folder, &key, ask),
        _ => ask(),
    }
}

/// The same with the key of the machine and the folder of the memory.
fn remembered(folder: &Path, key: &str, ask: impl FnOnce() -> bool) -> bool {
    if read_text(&folder.join(FILE), CONFIG_BYTES).is_ok_and(|known| known == key) {
        return false;
    }
    let found = ask();
    if !found {
        let staged = Staged::new(folder).and_then(|mut staged| {
            staged.add(FILE, key.as_bytes())?;
            staged.publish()
        });
        // Without the file, the next run asks again.
        drop(staged);
    }
    found
}

/// What the answer depends on: the program, the start of the system, drivers, devices, variables.
/// None where the system does not show them.
fn key() -> Option<String> {
    let boot = read_text(Path::new("/proc/sys/kernel/random/boot_id"), CONFIG_BYTES).ok()?;
    let mut parts = vec![env!("CARGO_PKG_VERSION").to_owned(), boot];
    let root = Path::new("/");
    let folders = manifest_folders(root).into_iter().chain(layer_folders(root));
    folders.for_each(|folder| parts.extend(drivers(&folder)));
    parts.extend(names(Path::new("/dev/dri")));
    let graphics = |name: &String| GRAPHICS.iter().any(|begin| name.starts_with(begin));
    parts.extend(names(Path::new("/dev")).into_iter().filter(graphics));
    let variables = std::env::vars_os().map(|(name, value)| format!("{name:?}={value:?}"));
    let counts = |text: &String| VARIABLES.iter().any(|begin| text[1..].starts_with(begin));
    let mut variables: Vec<String> = variables.filter(counts).collect();
    variables.sort();
    parts.extend(variables);
    Some(sha256([parts.join("\n").as_bytes()]))
}

/// The files in a folder of drivers, each with its size and the time of its last change.
fn drivers(folder: &Path) -> Vec<String> {
    let line = |name: String| {
        let path = folder.join(name);
        let about = path.metadata().ok().map(|about| (about.len(), about.modified().ok()));
        format!("{} {about:?}", path.display())
    };
    names(folder).into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_no_is_asked_for_once_and_a_yes_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let asked = std::cell::Cell::new(0);
        let ask = |key: &str, answer: bool| {
            remembered(folder.path(), key, || {
                asked.set(asked.get() + 1);
                answer
            })
        };
        assert!(!ask("one", false) && !ask("one", true));
        assert_eq!(asked.get(), 1, "the answer is remembered");
        assert!(ask("two", true) && ask("two", true));
        assert_eq!(asked.get(), 3, "another machine is asked, and a yes each time");
        assert!(!ask("two", false) && !ask("two", true));
        // Another machine's answer has taken the place of the first.
        assert!(ask("one", true));
    }

    #[test]
    fn what_changes_the_answer_changes_the_key() {
        let folder = tempfile::tempdir().unwrap();
        let before = drivers(folder.path());
        std::fs::write(folder.path().join("driver.json"), "{}").unwrap();
        let with = drivers(folder.path());
        std::fs::write(folder.path().join("driver.json"), "{ }").unwrap();
        assert!(before != with && with != drivers(folder.path()));
        assert_eq!(names(&folder.path().join("nowhere")), Vec::<String>::new());
    }
}
