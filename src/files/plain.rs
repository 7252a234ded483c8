//! The one way to read files: plain ones alone, and never more of them than is expected.
//!
//! A pipe would be waited for, a device read without end.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Most bytes of a configuration.
pub(crate) const CONFIG_BYTES: u64 = 1 << 24;
/// Most bytes of a network, and of a record of results.
pub(crate) const RECORD_BYTES: u64 = 1 << 30;
/// Most bytes of an archive of races, of a checkpoint, and of a program.
#[cfg(feature = "import")]
pub(crate) const ARCHIVE_BYTES: u64 = 1 << 32;

/// Opens the plain file at `path`, through links.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidInput`] for a pipe, a device or a folder.
pub(crate) fn open(path: &Path) -> Result<File> {
    let kind = std::fs::metadata(path)?.file_type();
    let problem = match (kind.is_file(), kind.is_dir()) {
        (true, _) => return File::open(path),
        (_, true) => "it is a folder, expected a file",
        _ => "it is a pipe or a device, expected a plain file: write its content to one first",
    };
    Err(Error::new(ErrorKind::InvalidInput, problem))
}

/// The content of the plain file at `path`, of at most `most` bytes.
///
/// # Errors
/// Those of [`open`]; [`ErrorKind::FileTooLarge`] for a longer one.
pub(crate) fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let file = open(path)?;
    let refused = |size: u64| {
        let problem = format!("{size} bytes or more, at most {most} are read of such a file");
        Error::new(ErrorKind::FileTooLarge, problem)
    };
    let size = file.metadata()?.len();
    if size > most {
        return Err(refused(size));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or_default());
    // It may have grown, and what the kernel shows as a file has no size.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(refused(bytes.len() as u64)) } else { Ok(bytes) }
}

/// The same as text.
///
/// # Errors
/// Those of [`read`]; [`ErrorKind::InvalidData`] for what is no UTF-8.
pub(crate) fn read_text(path: &Path, most: u64) -> Result<String> {
    String::from_utf8(read(path, most)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let problem = format!("no text in UTF-8 (byte {at}, from 0, is none of it)");
        Error::new(ErrorKind::InvalidData, problem)
    })
}

/// Whether this user may not open `device` for reading and writing; no word about one that is not there.
#[cfg(feature = "gpu")]
pub(crate) fn is_denied(device: &Path) -> bool {
    let opened = File::options().read(true).write(true).open(device);
    opened.is_err_and(|error| error.kind() == ErrorKind::PermissionDenied)
}

/// Makes the names in `folder` outlast a power cut, where the system can.
pub(super) fn sync(folder: &Path) {
    if cfg!(unix) {
        _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_their_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        assert_eq!(read(&path, 4).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read(folder.path(), 5).unwrap_err().kind(), ErrorKind::InvalidInput);
        let missing = folder.path().join("missing");
        assert_eq!(read(&missing, 5).unwrap_err().kind(), ErrorKind::NotFound);
        std::fs::write(&path, b"ab\xff").unwrap();
        let error = read_text(&path, 5).unwrap_err();
        assert!(error.to_string().contains("byte 2"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_never_ends_is_not_read() {
        // Of a file of the kernel, the size is told as 0.
        assert!(!read_text(Path::new("/proc/self/status"), 1 << 20).unwrap().is_empty());
        assert_eq!(
            read(Path::new("/proc/self/status"), 9).unwrap_err().kind(),
            ErrorKind::FileTooLarge
        );
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        assert_eq!(read(&link, 9).unwrap_err().kind(), ErrorKind::InvalidInput);
    }
}
