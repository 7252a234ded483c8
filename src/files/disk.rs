//! Whether there is room on the disk for what a run is to write.

use std::path::Path;

use super::named;
use crate::error::{Error, Result};

/// Refuses work whose results, about `need` bytes, do not fit on the disk of `folder`, which is
/// there.
///
/// What is free may change while the work goes on: this only keeps hours of work from ending at a
/// disk that was full from the start.
///
/// # Errors
/// [`Error::NoRoom`] with both figures. A system that does not tell what is free is no obstacle.
pub fn check_room(folder: &Path, need: u64) -> Result<()> {
    match fs4::available_space(named(folder)) {
        Ok(free) if free < need => Err(Error::NoRoom { folder: folder.to_owned(), need, free }),
        _ => Ok(()),
    }
}
