//! Why a card that is there is not listed: devices, drivers and rights, as Linux shows them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::drivers::{manifest_folders, names};
use super::visible::Maker;
use crate::files::{CONFIG_BYTES, is_denied, read_text};

/// Variables that name the only descriptions of drivers that count; the first that is set wins.
const CHOSEN_MANIFESTS: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];
/// Folders of libraries, below the root.
const LIBRARIES: [&str; 10] = [
    "usr/lib/x86_64-linux-gnu",
    "usr/lib/aarch64-linux-gnu",
    "usr/lib64",
    "usr/lib",
    "usr/local/lib",
    "usr/local/lib64",
    "lib/x86_64-linux-gnu",
    "lib/aarch64-linux-gnu",
    "lib64",
    "lib",
];
/// What programs load to reach any Vulkan driver.
const LOADER: &str = "libvulkan.so.1";

/// What the system shows beside its adapters.
pub(super) struct Surroundings<'a> {
    /// Where its files are.
    pub(super) root: &'a Path,
    /// `VK_DRIVER_FILES` or the like, and what it names.
    pub(super) chosen: Option<Chosen>,
    /// `LD_LIBRARY_PATH`.
    pub(super) libraries: Vec<PathBuf>,
}

/// A variable that names descriptions of drivers.
pub(super) struct Chosen {
    pub(super) variable: &'static str,
    pub(super) files: Vec<PathBuf>,
}

impl<'a> Surroundings<'a> {
    /// Those of this process, with the files of the system below `root`.
    pub(super) fn of_process(root: &'a Path) -> Self {
        let paths = |list: &OsStr| std::env::split_paths(list).collect();
        let chosen = CHOSEN_MANIFESTS.into_iter().find_map(|variable| {
            std::env::var_os(variable).map(|list| Chosen { variable, files: paths(&list) })
        });
        let libraries = std::env::var_os("LD_LIBRARY_PATH").map(|list| paths(&list));
        Self { root, chosen, libraries: libraries.unwrap_or_default() }
    }

    /// Why a card that has files in `/dev` is not among the adapters, of which there are hardware ones
    /// of `makers`; a sentence for each reason, with what to do.
    pub(super) fn diagnosis(&self, makers: &[Maker]) -> Vec<String> {
        let mut reasons = Vec::new();
        if !self.finds(LOADER) {
            reasons.push(format!(
                "the Vulkan loader {LOADER} is not there: install it (Debian: libvulkan1)"
            ));
        }
        reasons.extend(self.missing_choice());
        let missing = |maker: Maker| !makers.contains(&maker);
        if missing(Maker::Nvidia) {
            reasons.extend(self.of_nvidia());
        }
        if missing(Maker::Amd) && missing(Maker::Other) {
            reasons.extend(self.of_nodes());
        }
        reasons
    }

    /// Files that a variable names, and that are not there.
    fn missing_choice(&self) -> Vec<String> {
        let Some(Chosen { variable, files }) = &self.chosen else { return Vec::new() };
        let gone = files.iter().filter(|file| !file.exists());
        gone.map(|file| {
            format!(
                "{variable} names {}, which is not there, and no other driver is looked for: \
                 correct it or unset it",
                file.display()
            )
        })
        .collect()
    }

    /// Why NVIDIA's cards are not listed, if their devices are there.
    fn of_nvidia(&self) -> Option<String> {
        let is_card = |name: &String| {
            name.strip_prefix("nvidia").is_some_and(|rest| rest.parse::<u32>().is_ok())
        };
        let device = names(&self.root.join("dev")).into_iter().find(is_card)?;
        let device = self.root.join("dev").join(device);
        let shown = format!("/dev/{}", device.file_name()?.to_string_lossy());
        if let Some(refused) = refused(&device) {
            return Some(format!("{shown} {refused}"));
        }
        let Some(manifest) = self.manifest(|name| name.contains("nvidia")) else {
            return Some(format!(
                "{shown} is there, but no description of NVIDIA's Vulkan driver (nvidia_icd.json): \
                 in a container ask for the driver's graphics part \
                 (NVIDIA_DRIVER_CAPABILITIES=all), else install it (Debian: nvidia-vulkan-icd)"
            ));
        };
        Some(self.of_library(&shown, &manifest))
    }

    /// Why cards that Mesa drives are not listed, if their devices are there.
    fn of_nodes(&self) -> Option<String> {
        let folder = self.root.join("dev/dri");
        let node = names(&folder)
            .into_iter()
            .find(|name| name.starts_with("renderD") && self.maker(name) != Some(Maker::Nvidia))?;
        let shown = format!("/dev/dri/{node}");
        if let Some(refused) = refused(&folder.join(&node)) {
            return Some(format!("{shown} {refused}"));
        }
        // lvp is the software driver, nvidia is looked for by itself.
        let drives = |name: &str| !name.contains("lvp") && !name.contains("nvidia");
        let Some(manifest) = self.manifest(drives) else {
            return Some(format!(
                "{shown} is there, but no description of a Vulkan driver for hardware: install one \
                 (Debian: mesa-vulkan-drivers)"
            ));
        };
        Some(self.of_library(&shown, &manifest))
    }

    /// Who made the card behind a node, where the system tells.
    fn maker(&self, node: &str) -> Option<Maker> {
        let path = self.root.join("sys/class/drm").join(node).join("device/vendor");
        let text = read_text(&path, CONFIG_BYTES).ok()?;
        u32::from_str_radix(text.trim().trim_start_matches("0x"), 16).ok().map(Maker::of)
    }

    /// What of the driver behind a description is missing.
    fn of_library(&self, device: &str, manifest: &Path) -> String {
        let library = library(manifest).unwrap_or_default();
        if !library.is_empty() && !self.finds(&library) {
            return format!(
                "{device} is there, and {} names the driver {library}, which is not there: install \
                 the driver's libraries, of the version of its kernel module",
                manifest.display()
            );
        }
        format!(
            "{device} and the driver of {} are there, but list no adapter: kernel module and \
             libraries of the driver must be of one version (vulkaninfo says more)",
            manifest.display()
        )
    }

    /// A description of a driver whose name fits.
    fn manifest(&self, fits: impl Fn(&str) -> bool) -> Option<PathBuf> {
        let all: Vec<PathBuf> = match &self.chosen {
            Some(chosen) => chosen.files.clone(),
            None => {
                let folders = manifest_folders(self.root).into_iter();
                folders.flat_map(|f| names(&f).into_iter().map(move |name| f.join(name))).collect()
            }
        };
        let name =
            |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
        all.into_iter().find(|path| path.exists() && name(path).is_some_and(|name| fits(&name)))
    }

    /// Whether a library is in the usual folders, or where its path says.
    fn finds(&self, library: &str) -> bool {
        if library.contains('/') {
            return Path::new(library).exists();
        }
        let usual = LIBRARIES.iter().map(|folder| self.root.join(folder));
        usual.chain(self.libraries.iter().cloned()).any(|folder| folder.join(library).exists())
    }
}

/// Why a device cannot be used, if it cannot.
fn refused(device: &Path) -> Option<String> {
    is_denied(device).then(|| {
        "is there, but this user may not open it: become a member of the group that owns it \
         (render or video), or let the container have the device"
            .to_owned()
    })
}

/// The library that a description names.
fn library(manifest: &Path) -> Option<String> {
    let text = read_text(manifest, CONFIG_BYTES).ok()?;
    let document: serde_json::Value = serde_json::from_str(&text).ok()?;
    document.pointer("/ICD/library_path")?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine of files.
    struct Machine(tempfile::TempDir);

    impl Machine {
        fn with(files: &[(&str, &str)]) -> Self {
            let machine = Self(tempfile::tempdir().unwrap());
            for (path, text) in files {
                let path = machine.0.path().join(path);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, text).unwrap();
            }
            machine
        }

        fn says(&self, makers: &[Maker]) -> Vec<String> {
            let root = self.0.path();
            Surroundings { root, chosen: None, libraries: Vec::new() }.diagnosis(makers)
        }
    }

    const LOADED: (&str, &str) = ("usr/lib64/libvulkan.so.1", "");
    const CARD: (&str, &str) = ("dev/nvidia0", "");
    const MANIFEST: (&str, &str) =
        ("etc/vulkan/icd.d/nvidia_icd.json", r#"{"ICD": {"library_path": "libGLX_nvidia.so.0"}}"#);

    #[test]
    fn a_card_without_a_driver_is_told_from_one_without_a_library() {
        let bare = Machine::with(&[LOADED, CARD]).says(&[]);
        assert!(bare.len() == 1 && bare[0].contains("NVIDIA_DRIVER_CAPABILITIES"), "{bare:?}");
        let half = Machine::with(&[LOADED, CARD, MANIFEST]).says(&[]);
        assert!(half.len() == 1 && half[0].contains("libGLX_nvidia.so.0"), "{half:?}");
        let library = ("usr/lib/libGLX_nvidia.so.0", "");
        let whole = Machine::with(&[LOADED, CARD, MANIFEST, library]).says(&[]);
        assert!(whole.len() == 1 && whole[0].contains("of one version"), "{whole:?}");
        let listed = Machine::with(&[LOADED, CARD]).says(&[Maker::Nvidia]);
        assert_eq!(listed, Vec::<String>::new());
    }

    #[test]
    fn a_machine_without_loader_or_cards_says_the_first_alone() {
        let none = Machine::with(&[("dev/null", "")]).says(&[]);
        assert!(none.len() == 1 && none[0].contains("libvulkan1"), "{none:?}");
        assert_eq!(Machine::with(&[LOADED]).says(&[]), Vec::<String>::new());
    }

    #[test]
    fn a_node_is_mesas_unless_nvidia_made_it() {
        let node = ("dev/dri/renderD128", "");
        let lavapipe = ("usr/share/vulkan/icd.d/lvp_icd.json", "{}");
        let says = Machine::with(&[LOADED, node, lavapipe]).says(&[]);
        assert!(says.len() == 1 && says[0].contains("mesa-vulkan-drivers"), "{says:?}");
        let made = ("sys/class/drm/renderD128/device/vendor", "0x10de\n");
        assert_eq!(Machine::with(&[LOADED, node, made]).says(&[]), Vec::<String>::new());
    }

    #[test]
    fn a_driver_that_a_variable_names_in_vain_is_said() {
        let machine = Machine::with(&[LOADED, CARD, MANIFEST]);
        let files = vec![machine.0.path().join("gone.json")];
        let chosen = Some(Chosen { variable: "VK_DRIVER_FILES", files });
        let root = machine.0.path();
        let says = Surroundings { root, chosen, libraries: Vec::new() }.diagnosis(&[]);
        assert!(says[0].contains("VK_DRIVER_FILES") && says[0].contains("gone.json"), "{says:?}");
    }

    #[test]
    #[cfg(unix)]
    fn a_device_that_may_not_be_opened_is_a_matter_of_groups() {
        use std::os::unix::fs::PermissionsExt;
        let machine = Machine::with(&[LOADED, CARD, MANIFEST]);
        let device = machine.0.path().join("dev/nvidia0");
        std::fs::set_permissions(&device, std::fs::Permissions::from_mode(0o000)).unwrap();
        // The superuser may open everything.
        if std::fs::File::open(&device).is_err() {
            let says = machine.says(&[]);
            assert!(says[0].contains("group"), "{says:?}");
        } else {
            assert_eq!(refused(Path::new("/nonexistent")), None);
        }
    }
}
