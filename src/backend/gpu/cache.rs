//! Compiled pipelines kept on disk between runs, where the driver lets go of them (Vulkan).

use std::path::PathBuf;

use crate::digest::sha256;
use crate::files::{RECORD_BYTES, Staged, read};

/// A folder for the file, or `off`.
const VARIABLE: &str = "REACHCAST_PIPELINE_CACHE";
/// Bytes of the digest that the file opens with.
const DIGEST_BYTES: usize = 64;
/// A file that has grown beyond this is started afresh: drivers never forget a pipeline.
const MOST_BYTES: usize = 64 << 20;

/// The driver's pipelines, and the file that they come from and go to.
///
/// Nothing here is an error: a file that is damaged, of another driver or not to be written costs
/// the time that it would have saved.
pub(super) struct PipelineCache {
    inner: wgpu::PipelineCache,
    folder: PathBuf,
    name: String,
    stored: Option<Vec<u8>>,
}

impl PipelineCache {
    /// The pipelines of earlier runs; `None` if the adapter has no such cache, or if it is off.
    pub(super) fn open(device: &wgpu::Device) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let name = wgpu::util::pipeline_cache_key(&device.adapter_info())?;
        let folder = folder()?;
        let stored = read(&folder.join(&name), RECORD_BYTES).ok().and_then(whole);
        let descriptor =
            wgpu::PipelineCacheDescriptor { label: None, data: stored.as_deref(), fallback: true };
        #[allow(unsafe_code, reason = "the only way to give pipelines back to a driver")]
        // SAFETY: `stored` has the digest that `drop` put before what `get_data` returned, so it
        // is that data; wgpu compares adapter and driver, and starts empty where they differ.
        // Who can forge the digest can write to the user's own folder.
        let inner = unsafe { device.create_pipeline_cache(&descriptor) };
        Some(Self { inner, folder, name, stored })
    }

    /// What pipelines are built with.
    pub(super) fn handle(&self) -> &wgpu::PipelineCache {
        &self.inner
    }
}

impl Drop for PipelineCache {
    /// Stores the pipelines if there are others than those that were read.
    fn drop(&mut self) {
        let data = self.inner.get_data().filter(|data| data.len() <= MOST_BYTES);
        if let Some(data) = data
            && self.stored.as_ref() != Some(&data)
        {
            let bytes = [sha256([data.as_slice()]).as_bytes(), &data].concat();
            let staged = Staged::new(&self.folder).and_then(|mut staged| {
                staged.add(&self.name, &bytes)?;
                staged.publish()
            });
            // Without the file, the next run compiles again.
            drop(staged);
        }
    }
}

/// The data of a file whose digest is right and whose size is not yet too large.
fn whole(mut file: Vec<u8>) -> Option<Vec<u8>> {
    let data = file.split_off(DIGEST_BYTES.min(file.len()));
    let sound = data.len() < MOST_BYTES && sha256([data.as_slice()]).as_bytes() == file;
    sound.then_some(data)
}

/// The folder that the variable names, else one in the user's folder for caches.
pub(crate) fn folder() -> Option<PathBuf> {
    match std::env::var_os(VARIABLE) {
        Some(value) if value == "off" => None,
        Some(value) if !value.is_empty() => Some(value.into()),
        _ => user_folder().map(|folder| folder.join("reachcast")),
    }
}

/// Where programs of this user keep what they can make again.
fn user_folder() -> Option<PathBuf> {
    let absolute =
        |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let system = if cfg!(windows) { absolute("LOCALAPPDATA") } else { None };
    let home = || std::env::home_dir().map(|home| home.join(".cache"));
    absolute("XDG_CACHE_HOME").or(system).or_else(home)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_files_count() {
        let data = b"pipelines of a driver".to_vec();
        let file = [sha256([data.as_slice()]).as_bytes(), &data].concat();
        assert_eq!(whole(file.clone()), Some(data));
        assert_eq!(whole(file[..file.len() - 1].to_vec()), None, "cut short");
        assert_eq!(whole(file[..10].to_vec()), None, "cut within the digest");
        for at in [0, DIGEST_BYTES, file.len() - 1] {
            let mut damaged = file.clone();
            damaged[at] ^= 1;
            assert_eq!(whole(damaged), None, "byte {at}");
        }
    }
}
