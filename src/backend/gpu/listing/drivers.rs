//! Where the Vulkan drivers of this machine say that they are there.

use std::path::{Path, PathBuf};

/// Folders of descriptions, one file per driver.
const MANIFESTS: [&str; 3] =
    ["usr/share/vulkan/icd.d", "usr/local/share/vulkan/icd.d", "etc/vulkan/icd.d"];
/// Folders of layers, which change what drivers list.
const LAYERS: [&str; 2] = ["usr/share/vulkan/implicit_layer.d", "etc/vulkan/implicit_layer.d"];
/// The same in the folder of the user, below its home.
const OWN_MANIFESTS: [&str; 2] = [".local/share/vulkan/icd.d", ".config/vulkan/icd.d"];

/// The folders of descriptions of drivers below `root`, and those of the user.
pub(in crate::backend::gpu) fn manifest_folders(root: &Path) -> Vec<PathBuf> {
    let own = std::env::home_dir().map(|home| OWN_MANIFESTS.map(|inner| home.join(inner)));
    MANIFESTS.iter().map(|folder| root.join(folder)).chain(own.into_iter().flatten()).collect()
}

/// The folders of layers below `root`.
pub(in crate::backend::gpu) fn layer_folders(root: &Path) -> Vec<PathBuf> {
    LAYERS.iter().map(|folder| root.join(folder)).collect()
}

/// The names of what is in a folder, in order; none where it cannot be read.
pub(in crate::backend::gpu) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
